//! The cells of one label, and which features hang together.

use super::RUN;
use super::local::edges_of;
use super::weights::NONE;
use crate::lattice::Lattice;
use crate::{Interrupted, Watch};
use rayon::prelude::*;

/// The quads of one label, and their corners.
#[derive(Debug)]
pub(super) struct Component {
    pub(super) label: u32,
    pub(super) quads: Vec<usize>,
    pub(super) nodes: Vec<usize>,
}

/// The components in order of their labels, and the component of every cell.
pub(super) fn components(
    lattice: &Lattice,
    labels: &[u32],
    watch: Watch,
) -> Result<(Vec<Component>, Vec<u32>), Interrupted> {
    let present = distinct(labels, watch)?;
    let index = |label: &u32| present.binary_search(label).map_or(NONE, |index| index as u32);
    let mut component_of = vec![NONE; labels.len()];
    let runs = component_of.par_chunks_mut(RUN).zip(labels.par_chunks(RUN));
    runs.try_for_each(|(components, labels)| {
        components.iter_mut().zip(labels).for_each(|(component, label)| *component = index(label));
        watch.go_on()
    })?;
    let mut sizes = vec![0; present.len()];
    component_of.iter().filter(|&&component| component != NONE).for_each(|&component| sizes[component as usize] += 1);
    let empty =
        |(&label, &size): (&u32, &usize)| Component { label, quads: Vec::with_capacity(size), nodes: Vec::new() };
    let mut components: Vec<Component> = present.iter().zip(&sizes).map(empty).collect();
    for (quad, &component) in component_of.iter().enumerate() {
        if quad % RUN == 0 {
            watch.go_on()?;
        }
        if component != NONE {
            components[component as usize].quads.push(quad);
        }
    }
    components.par_iter_mut().try_for_each(|component| {
        component.nodes = corners(&component.quads, lattice.nodes[0]);
        watch.go_on()
    })?;
    Ok((components, component_of))
}

/// The labels there are but 0, rising.
fn distinct(labels: &[u32], watch: Watch) -> Result<Vec<u32>, Interrupted> {
    let of_run = |labels: &[u32]| {
        let mut present = labels.to_vec();
        present.sort_unstable();
        present.dedup();
        watch.go_on().map(|()| present)
    };
    let runs = labels.par_chunks(RUN).map(of_run).collect::<Result<Vec<_>, _>>()?;
    let mut present = runs.concat();
    present.sort_unstable();
    present.dedup();
    present.retain(|&label| label != 0);
    Ok(present)
}

/// The corners of quads given in order, in order, each once.
fn corners(quads: &[usize], columns: usize) -> Vec<usize> {
    let mut nodes: Vec<usize> = Vec::with_capacity(4 * quads.len());
    nodes.extend(quads.iter().flat_map(|&quad| {
        let (_, from, to) = edges_of(quad, columns).0[0];
        [from, to]
    }));
    nodes.extend(quads.iter().flat_map(|&quad| {
        let (_, from, to) = edges_of(quad, columns).0[1];
        [from, to]
    }));
    // Two runs that rise: merged, not sorted.
    nodes.sort();
    nodes.dedup();
    nodes.shrink_to_fit();
    nodes
}

/// Components that share nodes, directly or through others: indices, rising within a group and by their first.
pub(super) fn touching(
    components: &[Component],
    node_count: usize,
    watch: Watch,
) -> Result<Vec<Vec<usize>>, Interrupted> {
    watch.reserve(node_count * size_of::<u32>())?;
    let mut owner = vec![NONE; node_count];
    let mut parent: Vec<usize> = (0..components.len()).collect();
    fn root(parent: &mut [usize], mut index: usize) -> usize {
        while parent[index] != index {
            parent[index] = parent[parent[index]];
            index = parent[index];
        }
        index
    }
    for (index, component) in components.iter().enumerate() {
        watch.go_on()?;
        for &node in &component.nodes {
            if owner[node] == NONE {
                owner[node] = index as u32;
            } else {
                let (a, b) = (root(&mut parent, owner[node] as usize), root(&mut parent, index));
                parent[a.max(b)] = a.min(b);
            }
        }
    }
    let mut groups: Vec<Vec<usize>> = vec![Vec::new(); components.len()];
    for index in 0..components.len() {
        groups[root(&mut parent, index)].push(index);
    }
    groups.retain(|group| !group.is_empty());
    Ok(groups)
}

/// All quads and nodes of several components as one, which has the lowest of their labels.
pub(super) fn united(components: &[Component], group: &[usize]) -> Component {
    let joined = |part: fn(&Component) -> &Vec<usize>| {
        let mut all: Vec<usize> = group.iter().flat_map(|&index| part(&components[index])).copied().collect();
        all.sort_unstable();
        all.dedup();
        all
    };
    Component { label: components[group[0]].label, quads: joined(|c| &c.quads), nodes: joined(|c| &c.nodes) }
}
