//! Priors of the model of a session: what is known of a wrist before it is measured. The diagnosis compares models with the same ones.

/// Prior of a spread within or between conditions: scaled inverse chi-square with these degrees of freedom, as many as four trials would
/// give, about [`SPREAD_SD`].
pub const SPREAD_DEGREES: f64 = 4.0;

/// Standard deviation of a logarithm about which the prior of a spread lies: a person's short-range stiffness varies by 2 to 3 % from
/// trial to trial.
pub const SPREAD_SD: f64 = 0.03;

/// Standard deviation of the prior of the exponents of velocity and torque, about zero: exponents of wrist parameters lie between
/// minus and plus one (section 3 of de Vlugt et al. 2011).
pub const EXPONENT_SD: f64 = 1.0;

/// Standard deviation of the prior of the logarithm of a parameter at mean velocity and torque: none to speak of.
pub const LEVEL_SD: f64 = 100.0;

/// Prior of k_dec as a part of k_srs: median, and standard deviation of the logarithm. The paper finds it below k_srs in all conditions
/// (3.2, 3.3), without figures.
pub const DECREMENT_RATIO: (f64, f64) = (0.6, 0.5);
