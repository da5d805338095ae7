//! Several tests at once.

/// Holm's (1979) adjustment: p-values that may be compared with the level that all tests together shall keep.
pub fn holm(p: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..p.len()).collect();
    order.sort_by(|a, b| p[*a].total_cmp(&p[*b]));
    let mut adjusted = vec![f64::NAN; p.len()];
    let mut so_far: f64 = 0.0;
    for (rank, test) in order.into_iter().enumerate() {
        so_far = so_far.max((p.len() - rank) as f64 * p[test]).min(1.0);
        adjusted[test] = so_far;
    }
    adjusted
}
