//! All pairs of a run: what is asked of which node, and what that asks of others.

use std::collections::{HashMap, HashSet};

use crate::graph::plan::Plan;
use crate::node::Request;

/// A node and what is asked of it.
#[derive(Debug)]
pub(crate) struct Pair {
    pub node: usize,
    pub request: Request,
    /// Per slot of the node, the pairs that answer its requests.
    pub slots: Vec<Vec<usize>>,
    /// The pairs that give its links.
    pub links: Vec<usize>,
    /// Pairs that have this one in their slots or links, once per edge.
    pub consumers: Vec<usize>,
}

impl Pair {
    /// Everything it waits for, once per edge.
    pub fn inputs(&self) -> impl Iterator<Item = usize> + '_ {
        self.slots.iter().flatten().chain(&self.links).copied()
    }
}

/// The pairs of a run.
pub(crate) struct Pairs {
    pub list: Vec<Pair>,
    /// Per frame of the run, in order, the targets that first come up there.
    pub frames: Vec<(Option<i64>, Vec<usize>)>,
    /// Per target, its place in `frames`.
    pub frame_of_target: HashMap<usize, usize>,
    /// All pairs, each after its inputs; of a node, frame by frame.
    pub order: Vec<usize>,
}

impl Pairs {
    /// Follows every request from the targets to the sources. Works through a list, so a graph may be any depth.
    pub fn expand(plan: &Plan) -> Self {
        let mut pairs =
            Self { list: Vec::new(), frames: Vec::new(), frame_of_target: HashMap::new(), order: Vec::new() };
        let mut known: HashMap<(usize, Request), usize> = HashMap::new();
        let mut counted = HashSet::new();
        let frames: Vec<Option<i64>> =
            if plan.frames.is_empty() { vec![None] } else { plan.frames.iter().copied().map(Some).collect() };
        for frame in frames {
            let mut next = pairs.list.len();
            let request = Request::whole(frame);
            let mut targets: Vec<usize> =
                plan.targets.iter().map(|&node| pairs.intern(plan, &mut known, node, &request)).collect();
            targets.retain(|&target| counted.insert(target));
            while next < pairs.list.len() {
                pairs.connect(plan, &mut known, next);
                next += 1;
            }
            if !targets.is_empty() {
                pairs.frame_of_target.extend(targets.iter().map(|&target| (target, pairs.frames.len())));
                pairs.frames.push((frame, targets));
            }
        }
        for at in 0..pairs.list.len() {
            let inputs: Vec<usize> = pairs.list[at].inputs().collect();
            inputs.into_iter().for_each(|input| pairs.list[input].consumers.push(at));
        }
        pairs.order = pairs.in_order(plan);
        pairs
    }

    fn in_order(&self, plan: &Plan) -> Vec<usize> {
        let mut rank = vec![0; plan.nodes.len()];
        plan.order.iter().enumerate().for_each(|(at, &node)| rank[node] = at);
        let mut order: Vec<usize> = (0..self.list.len()).collect();
        order.sort_by_key(|&at| (rank[self.list[at].node], self.list[at].request.frame));
        order
    }

    fn intern(
        &mut self,
        plan: &Plan,
        known: &mut HashMap<(usize, Request), usize>,
        node: usize,
        request: &Request,
    ) -> usize {
        let request = plan.canonical(node, request);
        *known.entry((node, request.clone())).or_insert_with(|| {
            let pair = Pair { node, request, slots: Vec::new(), links: Vec::new(), consumers: Vec::new() };
            self.list.push(pair);
            self.list.len() - 1
        })
    }

    fn connect(&mut self, plan: &Plan, known: &mut HashMap<(usize, Request), usize>, at: usize) {
        let node = &plan.nodes[self.list[at].node];
        let request = self.list[at].request.clone();
        let mut slots = Vec::with_capacity(node.slots.len());
        for slot in &node.slots {
            let needs = node.prototype.needs(&slot.port, &request, &plan.frames);
            slots.push(needs.iter().map(|need| self.intern(plan, known, slot.source, need)).collect());
        }
        let links = node.links.iter().map(|&(source, _)| self.intern(plan, known, source, &request)).collect();
        self.list[at].slots = slots;
        self.list[at].links = links;
    }
}
