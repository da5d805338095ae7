//! The fit whose estimates are asked about, with other constants of the rig.

use crate::fit::data::observations::Observations;
use crate::fit::fitted::fit::Fit;
use crate::fit::population::session_fit::SessionFit;

/// The fit whose estimates are asked about.
#[derive(Debug, Clone, Copy)]
pub enum AskedFit<'a> {
    /// Each trial on its own.
    Trials(&'a Fit),
    /// The session as a whole.
    Session(&'a SessionFit),
}

impl AskedFit<'_> {
    /// The fit to the same session with other constants, from the optimum of this one. `None` if the session model is not defined.
    pub fn refitted_to(self, observations: &Observations) -> Option<Fit> {
        match self {
            Self::Trials(fit) => Some(fit.refitted_to(observations)),
            Self::Session(session) => session.refitted_to(observations).ok().map(|own| own.fit),
        }
    }
}
