//! Grouping by a key.

use std::collections::BTreeMap;

/// Groups the indices `0..count` by their key: keys ascend, and so do the indices of each group.
///
/// # Example
/// ```
/// let torques_nm = [1, 2, 1];
/// let groups = ramphold::statistics::group_indices(3, |trial| torques_nm[trial]);
/// assert_eq!(groups.into_iter().collect::<Vec<_>>(), [(1, vec![0, 2]), (2, vec![1])]);
/// ```
pub fn group_indices<K: Ord>(count: usize, key: impl Fn(usize) -> K) -> BTreeMap<K, Vec<usize>> {
    let mut groups: BTreeMap<K, Vec<usize>> = BTreeMap::new();
    for index in 0..count {
        groups.entry(key(index)).or_default().push(index);
    }
    groups
}
