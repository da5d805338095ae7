//! What is not known of motions that are known from records in steps.

use std::sync::Arc;

use crate::wrist::Kinematics;

/// What is not known of the motions of one velocity. All errors are independent and of unit variance, and are changes of the motion that
/// drives the model.
#[derive(Debug)]
pub struct MotionErrors {
    /// Errors that its trials share: the change of this trial's motion by each.
    pub shared: Vec<Vec<Kinematics<f64>>>,
    /// Errors of each trial's own; the same for all trials of the velocity.
    pub own: Arc<Vec<Vec<Kinematics<f64>>>>,
}
