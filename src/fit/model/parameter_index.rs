//! Positions of the six base parameters in the parameter vector of a trial.
//!
//! The parameters of mechanisms follow the base parameters, mechanism by mechanism; see
//! [`Model::mechanism_ranges`](super::specification::Model::mechanism_ranges).

/// Index of the joint inertia I_j, kg m2.
pub const I_J: usize = 0;
/// Index of the damping of the hand interface b_h, N m s/rad.
pub const B_H: usize = 1;
/// Index of the stiffness of the hand interface k_h, N m/rad.
pub const K_H: usize = 2;
/// Index of the short-range stiffness k_srs, N m/rad.
pub const K_SRS: usize = 3;
/// Index of the decrement of stiffness beyond the elastic limit k_dec, N m/rad.
pub const K_DEC: usize = 4;
/// Index of the elastic limit x_e, rad.
pub const X_E: usize = 5;

#[test]
fn indices_match_the_order_of_the_base_parameters() {
    let symbols = ["i_j_", "b_h_", "k_h_", "k_srs_", "k_dec_", "x_e_"];
    for (index, symbol) in [I_J, B_H, K_H, K_SRS, K_DEC, X_E].into_iter().zip(symbols) {
        let name = crate::wrist::BASE_PARAMETERS[index];
        assert!(name.starts_with(symbol), "{name} at index {index}");
    }
}
