//! Partition of the trials of a session into components, and of the coordinates of a component into blocks and a border.

use super::component::Component;
use crate::fit::data::observations::Observations;
use crate::fit::model::specification::Scope;

/// Components of a session in which the coordinate `c` affects the trials `affected[c]`. `block_scope` is the scope of a block:
/// trial or condition; with any other scope all coordinates belong to the border. `is_own` tells which coordinates are those of a single
/// block by their scope: one that only happens to affect a single block, such as I_j of a repetition of one trial, belongs to the border.
pub fn partition(
    observations: &Observations,
    block_scope: Scope,
    affected: &[Vec<usize>],
    is_own: &[bool],
) -> Vec<Component> {
    let block_key: Vec<usize> = (0..observations.trials.len())
        .map(|trial| match block_scope {
            Scope::Condition => observations.trials[trial].condition,
            _ => trial,
        })
        .collect();
    let representatives = representatives(&block_key, affected);
    let mut distinct = representatives.clone();
    distinct.sort_unstable();
    distinct.dedup();
    let component = |representative: usize| {
        let trials: Vec<usize> =
            (0..block_key.len()).filter(|trial| representatives[*trial] == representative).collect();
        let mut keys: Vec<usize> = trials.iter().map(|trial| block_key[*trial]).collect();
        keys.sort_unstable();
        keys.dedup();
        let block = |trial: usize| keys.binary_search(&block_key[trial]).unwrap_or(0);
        let mut component = Component {
            block_of_trial: trials.iter().map(|trial| block(*trial)).collect(),
            blocks: vec![Vec::new(); keys.len()],
            border: Vec::new(),
            border_prior: None,
            trials,
        };
        for (coordinate, members) in affected.iter().enumerate() {
            if representatives[members[0]] != representative {
                continue;
            }
            let own = block(members[0]);
            if is_own[coordinate] && members.iter().all(|trial| block(*trial) == own) {
                component.blocks[own].push(coordinate);
            } else {
                component.border.push(coordinate);
            }
        }
        component
    };
    distinct.into_iter().map(component).collect()
}

/// For each trial, the first trial of its component: trials belong together if they share a coordinate or a block (union-find).
fn representatives(block_key: &[usize], affected: &[Vec<usize>]) -> Vec<usize> {
    let count = block_key.len();
    let mut parent: Vec<usize> = (0..count).collect();
    fn find(parent: &mut [usize], mut trial: usize) -> usize {
        while parent[trial] != trial {
            parent[trial] = parent[parent[trial]];
            trial = parent[trial];
        }
        trial
    }
    let mut join = |a: usize, b: usize| {
        let (a, b) = (find(&mut parent, a), find(&mut parent, b));
        parent[a.max(b)] = a.min(b);
    };
    for members in affected {
        members.iter().for_each(|trial| join(members[0], *trial));
    }
    for trial in 0..count {
        if let Some(other) = (0..trial).find(|other| block_key[*other] == block_key[trial]) {
            join(other, trial);
        }
    }
    (0..count).map(|trial| find(&mut parent, trial)).collect()
}
