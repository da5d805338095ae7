//! The linear part of the base model over one step, solved exactly.
//!
//! Lever, interface and the joint before its yield are linear: z' = M z + f(x), with x from 0 to 1 over the step. Speeds are changes per
//! step, so that M has no unit. The motor and the torque that the yield takes away enter as polynomials f of the third degree. With
//! phi_m(M) = sum_k M^k / (k + m)!, a state becomes phi_0(M) z and a force x^m along v adds m! phi_(m+1)(M) v (Hochbruck and Ostermann
//! 2010, Exponential integrators, section 2).

use super::plant::Plant;
use crate::number::{Jet, Number, Plain};

/// The number of terms of the series. Up to [`LONGEST_LINEAR_STEP`] the terms left out are below 1e-13 of the sum.
pub(super) const TERMS: usize = 16;

/// Greatest product of the fastest rate of the linear part and the step.
pub(super) const LONGEST_LINEAR_STEP: f64 = 1.0;

/// Number of coefficients of a force: a polynomial of the third degree.
pub(super) const FORCE: usize = 4;

/// 1/n!.
pub(super) const TAYLOR_WEIGHTS: [f64; TERMS + FORCE + 1] = {
    let mut all = [1.0; TERMS + FORCE + 1];
    let mut n = 1;
    while n < all.len() {
        all[n] = all[n - 1] / n as f64;
        n += 1;
    }
    all
};

/// The parameters of the linear part: I_j, b_h, k_h and k_srs, the first four of the base model.
pub(super) const LINEAR_PARAMETERS: usize = 4;

/// What a step does to a state of `STATES` angles and speeds, each followed by its speed: the handle's, if the lever is compliant, then
/// the joint's. Each coefficient has `N` derivatives: by the [`LINEAR_PARAMETERS`], by more where a mechanism alters the linear part, or
/// none.
#[derive(Debug, Clone, Copy)]
pub(super) struct LinearResponse<P, const STATES: usize, const N: usize> {
    /// From a state, by column, to the state a step later, by row.
    pub transition: [[Jet<P, N>; STATES]; STATES],
    /// From the coefficients of the motor's angle, rad.
    pub motor: [[Jet<P, N>; FORCE]; STATES],
    /// From the coefficients of a torque on the joint, N m.
    pub joint_torque: [[Jet<P, N>; FORCE]; STATES],
    /// From the coefficients of a torque on the handle, N m. A rigid lever has none.
    pub handle_torque: [[Jet<P, N>; FORCE]; STATES],
    /// Torque in the lever for a difference of angle between motor and what it turns, N m/rad, and of speed, N m step/rad.
    pub coupling: [Jet<P, N>; 2],
    /// The same of the interface, for a difference between handle and joint.
    pub interface: [Jet<P, N>; 2],
}

/// The acceleration of one inertia for each state, per step and step.
type Acceleration<P, const STATES: usize, const N: usize> = [Jet<P, N>; STATES];

impl<P: Plain, const STATES: usize, const N: usize> LinearResponse<P, STATES, N> {
    /// The response of `plant` over a step of `step_s`. A compliant lever has four states; a rigid one needs two, and of four the handle's
    /// stay zero.
    #[inline(always)]
    pub fn new(plant: &Plant<Jet<P, N>>, step_s: f64) -> Self {
        let (stiffness, damping) = (plant.interface_stiffness, plant.interface_damping);
        let per_inertia = Jet::constant(step_s) / plant.joint_inertia;
        let interface = [
            per_inertia * stiffness.scale(step_s), // by the difference of angle
            per_inertia * damping,                 // by the difference of speed
        ];
        let joint = STATES - 2;
        let zero = Jet::constant(0.0);
        let mut rows: [Acceleration<P, STATES, N>; 2] = [[zero; STATES]; 2];
        rows[1][joint] = -interface[0] - per_inertia * plant.short_range_stiffness.scale(step_s);
        rows[1][joint + 1] = -interface[1] - per_inertia * plant.joint_damping;
        let torque_at_interface = [stiffness, damping.scale(1.0 / step_s)];
        let coupling;
        // Acceleration of what the motor turns, by its angle and by its speed.
        let drive;
        let mut per_handle_torque = zero;
        match plant.lever {
            None => {
                drive = interface;
                coupling = torque_at_interface;
            }
            Some(lever) => {
                let per_lever = Jet::constant(step_s) / lever.inertia;
                per_handle_torque = per_lever.scale(step_s);
                let own = [per_handle_torque * lever.stiffness, per_lever * lever.damping];
                let across = [per_handle_torque * stiffness, per_lever * damping];
                let mut by = 0;
                while by < 2 {
                    rows[0][by] = -own[by] - across[by];
                    rows[0][joint + by] = across[by];
                    rows[1][by] = interface[by];
                    by += 1;
                }
                drive = own;
                coupling = [lever.stiffness, lever.damping / Jet::constant(step_s)];
            }
        }
        let mut response = Self {
            transition: [[zero; STATES]; STATES],
            motor: [[zero; FORCE]; STATES],
            joint_torque: [[zero; FORCE]; STATES],
            handle_torque: [[zero; FORCE]; STATES],
            coupling,
            interface: torque_at_interface,
        };
        // Index of the body that the motor turns.
        let driven = if plant.lever.is_some() { 0 } else { STATES / 2 - 1 };
        response.fill(&rows, (driven, drive), per_handle_torque, per_inertia.scale(step_s));
        response
    }

    /// `rows` holds the accelerations of handle and joint, at a rigid lever of the joint alone, in the last row.
    #[inline(always)]
    fn fill(
        &mut self,
        rows: &[Acceleration<P, STATES, N>; 2],
        (driven, drive): (usize, [Jet<P, N>; 2]),
        per_handle_torque: Jet<P, N>,
        per_joint_torque: Jet<P, N>,
    ) {
        let zero = Jet::constant(0.0);
        let bodies = STATES / 2;
        // phi_0 ... phi_4 of a unit change of speed of each body, the handle's first.
        let mut phi = [[[zero; STATES]; FORCE + 1]; 2];
        let mut body = 0;
        while body < bodies {
            phi[body] = of_unit_speed(rows, 2 * body + 1);
            body += 1;
        }
        let mut row = 0;
        while row < STATES {
            let mut body = 0;
            while body < bodies {
                self.transition[row][2 * body + 1] = phi[body][0][row];
                // phi_0 = 1 + phi_1 M, and M takes an angle to accelerations alone.
                let mut of_angle = Jet::constant(if row == 2 * body { 1.0 } else { 0.0 });
                let mut moved = 0;
                while moved < bodies {
                    of_angle = of_angle + phi[moved][1][row] * rows[2 - bodies + moved][2 * body];
                    moved += 1;
                }
                self.transition[row][2 * body] = of_angle;
                body += 1;
            }
            // The force of the motor is drive[0] u + drive[1] u', along the speed of the body that it turns.
            let mut power = 0;
            let mut factorial = 1.0;
            while power < FORCE {
                let own = phi[driven][power + 1][row].scale(factorial);
                self.motor[row][power] = own * drive[0];
                if power > 0 {
                    // The derivative of x^m is m x^(m-1), and m (m-1)! = m!.
                    self.motor[row][power] =
                        self.motor[row][power] + phi[driven][power][row].scale(factorial) * drive[1];
                }
                if bodies == 2 {
                    self.handle_torque[row][power] = own * per_handle_torque;
                }
                self.joint_torque[row][power] =
                    phi[bodies - 1][power + 1][row].scale(factorial) * per_joint_torque;
                power += 1;
                factorial *= power as f64;
            }
            row += 1;
        }
    }
}

/// phi_0 ... phi_4 of M, applied to a unit of the state `index`, a speed.
#[inline(always)]
fn of_unit_speed<P: Plain, const STATES: usize, const N: usize>(
    rows: &[Acceleration<P, STATES, N>; 2],
    index: usize,
) -> [[Jet<P, N>; STATES]; FORCE + 1] {
    let zero = Jet::constant(0.0);
    let bodies = STATES / 2;
    let mut power = [zero; STATES];
    power[index] = Jet::constant(1.0);
    let mut sums = [[zero; STATES]; FORCE + 1];
    let mut term = 0;
    loop {
        let mut row = 0;
        while row < STATES {
            let mut which = 0;
            while which <= FORCE {
                let weight = P::splat(TAYLOR_WEIGHTS[term + which]);
                sums[which][row] = sums[which][row].plus_scaled(power[row], weight);
                which += 1;
            }
            row += 1;
        }
        term += 1;
        if term == TERMS {
            return sums;
        }
        let mut next = [zero; STATES];
        let mut body = 0;
        while body < bodies {
            next[2 * body] = power[2 * body + 1];
            let row = &rows[2 - bodies + body];
            let mut sum = zero;
            let mut from = 0;
            while from < STATES {
                sum = sum.plus_product(row[from], power[from]);
                from += 1;
            }
            next[2 * body + 1] = sum;
            body += 1;
        }
        power = next;
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::DMatrix;

    use super::*;
    use crate::wrist::plant::{JOINT_DAMPING_NM_S_PER_RAD, Lever};

    /// The exponential of the same system with its forces as states, by nalgebra.
    #[test]
    fn a_step_is_the_matrix_exponential_of_its_system() {
        let lever = Lever { inertia_kg_m2: 0.0016, damping_nm_s_per_rad: 0.4, stiffness_nm_per_rad: 900.0 };
        let (step, joint_damping) = (4e-4, JOINT_DAMPING_NM_S_PER_RAD);
        let [i_j, b_h, k_h, k_srs] = [0.005, 1.2, 300.0, 20.0];
        let parameters = [i_j, b_h, k_h, k_srs, 13.0, 0.04].map(Jet::<f64, 0>::constant);
        let ours = LinearResponse::<f64, 4, 0>::new(&Plant::base(Some(lever), &parameters), step);
        let (i_l, b_l, k_l) = (lever.inertia_kg_m2, lever.damping_nm_s_per_rad, lever.stiffness_nm_per_rad);
        // Angles and speeds in rad and rad/s, then the force and its derivatives by time.
        let system = |force: [f64; 4]| {
            let mut own = DMatrix::zeros(8, 8);
            let rows = [
                [0.0, 1.0, 0.0, 0.0],
                [-(k_l + k_h) / i_l, -(b_l + b_h) / i_l, k_h / i_l, b_h / i_l],
                [0.0, 0.0, 0.0, 1.0],
                [k_h / i_j, b_h / i_j, -(k_h + k_srs) / i_j, -(b_h + joint_damping) / i_j],
            ];
            for (i, row) in rows.iter().enumerate() {
                for (j, value) in row.iter().enumerate() {
                    own[(i, j)] = *value;
                }
                own[(i, 4)] = force[i];
            }
            for k in 4..7 {
                own[(k, k + 1)] = 1.0;
            }
            (own * step).exp()
        };
        let joint = system([0.0, 0.0, 0.0, 1.0 / i_j]);
        let stiff = system([0.0, k_l / i_l, 0.0, 0.0]);
        let damped = system([0.0, b_l / i_l, 0.0, 0.0]);
        let handle = system([0.0, 1.0 / i_l, 0.0, 0.0]);
        let speed = |row: usize| if row % 2 == 1 { step } else { 1.0 };
        let power = |m: usize| [1.0, 1.0, 2.0, 6.0][m] / libm::pow(step, m as f64);
        let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-12 * b.abs().max(1e-3), "{a} and {b}");
        for row in 0..4 {
            for column in 0..4 {
                close(ours.transition[row][column].value, joint[(row, column)] * speed(row) / speed(column));
            }
            for m in 0..FORCE {
                close(ours.joint_torque[row][m].value, joint[(row, 4 + m)] * power(m) * speed(row));
                close(ours.handle_torque[row][m].value, handle[(row, 4 + m)] * power(m) * speed(row));
                let of_speed =
                    if m == 0 { 0.0 } else { damped[(row, 3 + m)] * power(m - 1) * m as f64 / step };
                let own = stiff[(row, 4 + m)] * power(m) + of_speed;
                close(ours.motor[row][m].value, own * speed(row));
            }
        }
    }
}
