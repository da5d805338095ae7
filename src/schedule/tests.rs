//! Orders are what they are called, uniform, and the same for ever.

use std::collections::HashMap;

use proptest::prelude::*;
use serde_json::json;

use super::drawing::conditions;
use super::*;
use crate::protocol::{Condition, Protocol, ValidProtocol};
use crate::random::Stream;

fn protocol(
    velocities: &[f64],
    torques: &[f64],
    repetitions: u32,
    order: serde_json::Value,
) -> ValidProtocol {
    let mut value: serde_json::Value =
        serde_json::from_str(include_str!("../../protocols/de-vlugt-2011.json")).unwrap();
    value["velocities_rad_s"] = json!(velocities);
    value["torques_nm"] = json!(torques);
    value["repetitions"] = json!(repetitions);
    value["order"] = order;
    Protocol::parse(&value.to_string(), "test").unwrap()
}

fn paper(order: serde_json::Value) -> ValidProtocol {
    protocol(&[1.3, 1.95, 2.6, 3.25], &[0.9, 1.5, 2.1], 3, order)
}

/// The order as indices of conditions.
fn indices(protocol: &ValidProtocol, order: &[ScheduledTrial]) -> Vec<usize> {
    let conditions = conditions(protocol);
    let is = |planned: &ScheduledTrial| {
        let condition = Condition { velocity_rad_s: planned.velocity_rad_s, torque_nm: planned.torque_nm };
        conditions.iter().position(|other| *other == condition).unwrap()
    };
    order.iter().map(is).collect()
}

fn drawn(protocol: &ValidProtocol, seed: u64, subject_number: Option<u32>) -> Vec<usize> {
    indices(protocol, &draw(protocol, seed, subject_number).unwrap())
}

#[test]
fn the_same_seed_gives_the_same_order_in_every_later_version() {
    let golden = [
        (json!({ "kind": "shuffled" }), GOLDEN[0]),
        (json!({ "kind": "blocked" }), GOLDEN[1]),
        (json!({ "kind": "constrained", "max_run": 2 }), GOLDEN[2]),
        (json!({ "kind": "constrained", "max_run": 1 }), GOLDEN[3]),
        (json!({ "kind": "williams" }), GOLDEN[4]),
    ];
    for (order, expected) in golden {
        assert_eq!(drawn(&paper(order.clone()), 2011, Some(3)), expected, "{order}");
    }
}

/// Conditions count their torques within their velocity. The shuffled and the blocked one were confirmed by an
/// implementation of ChaCha12, SHA-256 keys and Fisher-Yates apart from this crate's.
const GOLDEN: [[usize; 36]; 5] = [
    [
        5, 4, 7, 8, 8, 3, 11, 3, 7, 8, 10, 1, 6, 6, 0, 0, 2, 10, 1, 5, 7, 6, 2, 11, 9, 9, 3, 2, 9, 4, 11, 0,
        4, 10, 5, 1,
    ],
    [
        6, 9, 11, 7, 8, 5, 2, 0, 10, 3, 1, 4, 8, 4, 5, 9, 1, 0, 3, 2, 7, 11, 6, 10, 0, 3, 11, 1, 4, 2, 7, 6,
        10, 8, 5, 9,
    ],
    [
        4, 0, 8, 2, 10, 7, 8, 4, 9, 11, 1, 3, 1, 9, 6, 10, 6, 8, 5, 9, 5, 11, 0, 3, 7, 5, 10, 11, 2, 7, 1, 2,
        3, 4, 0, 6,
    ],
    [
        8, 0, 4, 0, 4, 6, 1, 8, 9, 1, 11, 7, 3, 7, 5, 6, 5, 10, 8, 1, 9, 7, 3, 11, 3, 11, 0, 4, 2, 10, 6, 2,
        10, 5, 9, 2,
    ],
    [
        2, 3, 1, 4, 0, 5, 11, 6, 10, 7, 9, 8, 3, 4, 2, 5, 1, 6, 0, 7, 11, 8, 10, 9, 4, 5, 3, 6, 2, 7, 1, 8,
        0, 9, 11, 10,
    ],
];

#[test]
fn put_back_places_are_the_same_in_every_later_version() {
    let places: Vec<usize> = (1..=8).map(|trial| put_back(2011, trial, 20)).collect();
    assert_eq!(places, [1, 9, 2, 18, 12, 1, 19, 7]);
}

#[test]
fn familiarisation_is_the_same_in_every_later_version_and_shows_all_before_it_repeats() {
    let mut many = (*paper(json!({ "kind": "shuffled" }))).clone();
    many.before.familiarisation_trials = 14;
    let many = many.validate().unwrap();
    let trials = familiarisation(&many, 2011);
    let conditions = conditions(&many);
    let shown: Vec<usize> =
        trials.iter().map(|trial| conditions.iter().position(|other| other == trial).unwrap()).collect();
    assert_eq!(shown, [0, 7, 5, 2, 9, 6, 3, 4, 8, 11, 10, 1, 9, 4]);
    let mut first: Vec<usize> = shown[..12].to_vec();
    first.sort_unstable();
    assert_eq!(first, (0..12).collect::<Vec<_>>());
}

/// Chi-square of the frequencies of orders against `expected_orders` equally likely ones.
fn chi_square(orders: impl Iterator<Item = Vec<usize>>, expected_orders: usize) -> f64 {
    let mut counts: HashMap<Vec<usize>, f64> = HashMap::new();
    let mut draws = 0.0;
    for order in orders {
        *counts.entry(order).or_default() += 1.0;
        draws += 1.0;
    }
    assert!(counts.len() <= expected_orders, "{} orders, {expected_orders} are possible", counts.len());
    let expected = draws / expected_orders as f64;
    let never_drawn = (expected_orders - counts.len()) as f64 * expected;
    never_drawn + counts.values().map(|count| (count - expected) * (count - expected) / expected).sum::<f64>()
}

/// The value that chi-square exceeds with probability 0.001 (Wilson and Hilferty 1931).
fn critical(orders: usize) -> f64 {
    let degrees = (orders - 1) as f64;
    let spread = 2.0 / (9.0 * degrees);
    degrees * (1.0 - spread + 3.0902 * spread.sqrt()).powi(3)
}

#[test]
fn every_order_is_equally_likely() {
    let protocol = protocol(&[1.3, 2.6], &[0.9, 2.1], 1, json!({ "kind": "shuffled" }));
    let statistic = chi_square((0..24_000).map(|seed| drawn(&protocol, seed, None)), 24);
    assert!(statistic < critical(24), "chi-square {statistic}");
}

#[test]
fn a_biased_shuffle_is_found_out() {
    // The classic mistake: swap every place with any place, 4^4 ways onto 24 orders.
    let biased = |seed| {
        let mut stream = Stream::new(seed, "order");
        let mut order: Vec<usize> = (0..4).collect();
        for place in 0..4 {
            order.swap(place, stream.below(4) as usize);
        }
        order
    };
    let statistic = chi_square((0..24_000).map(biased), 24);
    assert!(statistic > 2.0 * critical(24), "chi-square {statistic}");
}

#[test]
fn every_constrained_order_is_equally_likely() {
    for (velocities, torques, max_run) in [(2, 2, 2), (2, 3, 2), (3, 2, 2), (2, 3, 1)] {
        let order = json!({ "kind": "constrained", "max_run": max_run });
        let protocol = protocol(&[1.3, 1.95, 2.6][..velocities], &[0.9, 1.5, 2.1][..torques], 1, order);
        let label = |order: &[usize], of: fn(usize, usize) -> usize| {
            order.iter().map(|condition| of(*condition, torques)).collect::<Vec<_>>()
        };
        let longest = |labels: Vec<usize>| labels.chunk_by(|a, b| a == b).map(<[_]>::len).max();
        let valid = permutations(velocities * torques)
            .into_iter()
            .filter(|order| longest(label(order, |c, torques| c / torques)) <= Some(max_run))
            .filter(|order| longest(label(order, |c, torques| c % torques)) <= Some(max_run))
            .count();
        let draws = 40 * valid.max(100) as u64;
        let statistic = chi_square((0..draws).map(|seed| drawn(&protocol, seed, None)), valid);
        assert!(statistic < critical(valid), "{velocities} x {torques}: {statistic} for {valid} orders");
    }
}

fn permutations(count: usize) -> Vec<Vec<usize>> {
    if count == 0 {
        return vec![vec![]];
    }
    let insert = |shorter: Vec<usize>| {
        (0..count).map(move |place| {
            let mut longer = shorter.clone();
            longer.insert(place, count - 1);
            longer
        })
    };
    permutations(count - 1).into_iter().flat_map(insert).collect()
}

#[test]
fn a_rejected_trial_may_come_back_at_any_later_place() {
    let places = (0..11_000).map(|trial| vec![put_back(7, trial, 10)]);
    let statistic = chi_square(places, 11);
    assert!(statistic < critical(11), "chi-square {statistic}");
    assert_eq!(put_back(7, 1, 0), 0);
}

#[test]
fn a_fixed_order_is_as_written() {
    let trials = json!([
        { "velocity_rad_s": 2.6, "torque_nm": 0.9 }, { "velocity_rad_s": 1.3, "torque_nm": 0.9 },
        { "velocity_rad_s": 1.3, "torque_nm": 0.9 }, { "velocity_rad_s": 2.6, "torque_nm": 0.9 }
    ]);
    let protocol = protocol(&[1.3, 2.6], &[0.9], 2, json!({ "kind": "fixed", "trials": trials }));
    let order = draw(&protocol, 1, None).unwrap();
    assert_eq!(order.iter().map(|trial| trial.velocity_rad_s).collect::<Vec<_>>(), [2.6, 1.3, 1.3, 2.6]);
    assert_eq!(order.iter().map(|trial| trial.repetition).collect::<Vec<_>>(), [1, 1, 2, 2]);
}

#[test]
fn williams_asks_for_the_subject_s_number() {
    let protocol = paper(json!({ "kind": "williams" }));
    for number in [None, Some(0)] {
        let error = draw(&protocol, 1, number).unwrap_err();
        assert_eq!(error, DrawError::NoSubjectNumber { subject_number: number });
    }
}

#[test]
fn schedule_csv_has_the_columns_of_the_session_format() {
    let mut bytes = Vec::new();
    write_csv(
        &[ScheduledTrial { position: 1, velocity_rad_s: 1.95, torque_nm: 2.0, repetition: 3 }],
        &mut bytes,
    )
    .unwrap();
    assert_eq!(
        String::from_utf8(bytes).unwrap(),
        "position,velocity_rad_s,torque_nm,repetition\n1,1.95,2.0,3\n"
    );
}

fn kinds() -> impl Strategy<Value = serde_json::Value> {
    prop_oneof![
        Just(json!({ "kind": "shuffled" })),
        Just(json!({ "kind": "blocked" })),
        (2..5u32).prop_map(|max_run| json!({ "kind": "constrained", "max_run": max_run })),
        Just(json!({ "kind": "williams" })),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 128, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn every_order_has_each_condition_as_often_as_there_are_repetitions(
        velocities in 2..5usize, torques in 2..4usize, repetitions in 1..4u32, kind in kinds(),
        seed: u64, subject in 1..100u32,
    ) {
        let velocities = &[1.3, 1.95, 2.6, 3.25][..velocities];
        let protocol = protocol(velocities, &[0.9, 1.5, 2.1][..torques], repetitions, kind.clone());
        let order = draw(&protocol, seed, Some(subject)).unwrap();

        prop_assert!(order.iter().zip(1..).all(|(trial, position)| trial.position == position));
        let mut seen: Vec<(usize, u32)> =
            indices(&protocol, &order).into_iter().zip(order.iter().map(|trial| trial.repetition)).collect();
        seen.sort_unstable();
        let conditions = velocities.len() * torques;
        let expected: Vec<(usize, u32)> =
            (0..conditions).flat_map(|condition| (1..=repetitions).map(move |r| (condition, r))).collect();
        prop_assert_eq!(seen, expected);

        if kind["kind"] == "blocked" || kind["kind"] == "williams" {
            prop_assert!(order.iter().enumerate().all(|(index, trial)| trial.repetition as usize == index / conditions + 1));
        }
        if let Some(max_run) = kind["max_run"].as_u64() {
            let velocity_runs = order.chunk_by(|a, b| a.velocity_rad_s == b.velocity_rad_s);
            let torque_runs = order.chunk_by(|a, b| a.torque_nm == b.torque_nm);
            prop_assert!(velocity_runs.chain(torque_runs).all(|run| run.len() as u64 <= max_run));
        }
    }
}
