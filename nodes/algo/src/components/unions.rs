//! Disjoint sets.

/// Disjoint sets of the nodes 0, 1, ...; the least node of a set is its root, and no node's parent is greater than it.
#[derive(Default)]
pub(super) struct Unions {
    parents: Vec<u32>,
}

impl Unions {
    /// Adds nodes, each a set of its own, until there are `count`.
    pub(super) fn extend(&mut self, count: u32) {
        self.parents.extend(self.parents.len() as u32..count);
    }

    /// Adds a node, a set of its own.
    #[inline(always)]
    pub(super) fn add(&mut self) -> u32 {
        let node = self.parents.len() as u32;
        self.parents.push(node);
        node
    }

    /// A node of the same set, nearer to the root if there is one.
    #[inline(always)]
    pub(super) fn parent(&self, node: u32) -> u32 {
        self.parents[node as usize]
    }

    /// Root of the node's set; halves the path to it.
    fn root(&mut self, mut node: u32) -> u32 {
        loop {
            let parent = self.parents[node as usize];
            if parent == node {
                return node;
            }
            let grandparent = self.parents[parent as usize];
            self.parents[node as usize] = grandparent;
            node = grandparent;
        }
    }

    /// Unites the sets of two nodes.
    pub(super) fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        let (root, child) = (a.min(b), a.max(b));
        self.parents[child as usize] = root;
    }

    /// For each node the number of its set; sets are numbered from 0 in the order of their roots.
    pub(super) fn into_sets(self) -> Vec<u32> {
        let (mut sets, mut count) = (self.parents, 0);
        for node in 0..sets.len() {
            let parent = sets[node] as usize;
            // A parent comes before its child, so it holds its set's number already.
            sets[node] = if parent == node { count } else { sets[parent] };
            count += u32::from(parent == node);
        }
        sets
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sets_are_numbered_by_their_least_nodes() {
        let mut unions = Unions::default();
        unions.extend(7);
        unions.join(6, 3);
        unions.join(5, 1);
        unions.join(6, 5);
        unions.extend(9);
        unions.join(7, 2);
        assert_eq!(unions.into_sets(), [0, 1, 2, 1, 3, 1, 1, 2, 4]);
    }
}
