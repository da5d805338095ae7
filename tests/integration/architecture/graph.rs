//! Circles in a graph of imports, and orders without them.

use std::collections::{BTreeMap, BTreeSet};

/// For every node the nodes that it imports.
pub type Graph = BTreeMap<String, BTreeSet<String>>;

/// The strongly connected components with more than one node, each sorted.
pub fn circles(graph: &Graph) -> Vec<Vec<String>> {
    let reachable: BTreeMap<&str, BTreeSet<&str>> =
        graph.keys().map(|node| (node.as_str(), reachable_from(graph, node))).collect();
    let mut circles = BTreeSet::new();
    for (node, others) in &reachable {
        let circle: Vec<String> = others
            .iter()
            .filter(|other| reachable.get(*other).is_some_and(|back| back.contains(node)))
            .map(|other| (*other).to_owned())
            .collect();
        if circle.len() > 1 {
            circles.insert(circle);
        }
    }
    circles.into_iter().collect()
}

fn reachable_from<'a>(graph: &'a Graph, node: &str) -> BTreeSet<&'a str> {
    let mut reached = BTreeSet::new();
    let mut open: Vec<&str> = vec![node];
    while let Some(node) = open.pop() {
        for next in graph.get(node).into_iter().flatten() {
            if reached.insert(next.as_str()) {
                open.push(next);
            }
        }
    }
    reached
}

/// The imports that lead to a node that stands later in `order`, as `importer -> imported`.
pub fn imports_against(order: &[String], graph: &Graph) -> Vec<String> {
    let place = |node: &str| order.iter().position(|other| other == node);
    let mut against = Vec::new();
    for (from, targets) in graph {
        for to in targets {
            if place(to) > place(from) {
                against.push(format!("{from} -> {to}"));
            }
        }
    }
    against
}
