//! Differences between the trials' fitted parameters: outliers, covariates of the stiffness, the law of the elastic limit.

pub mod covariate_regression;
pub mod elastic_limit_law;
pub mod exchangeability;
pub mod outliers;
pub mod stiffness_table;
