//! The simulation of a group of trials, compiled for each vector width and kind of processor.
//!
//! Each has a module of its own: the compiler makes machine code of several modules at a time, and these take it longest.

/// One trial, on any processor.
pub(super) mod one {
    use crate::wrist::batch::Batch;
    use crate::wrist::passes::run;
    use crate::wrist::simulation::SimulatedTorque;

    pub fn simulate(batch: &Batch, response: &mut SimulatedTorque) {
        run::<f64>(batch, response);
    }
}

/// One trial, with the instruction for what is fused; without it the same bits take longer.
#[cfg(target_arch = "x86_64")]
pub(super) mod one_fused {
    use crate::wrist::batch::Batch;
    use crate::wrist::passes::run;
    use crate::wrist::simulation::SimulatedTorque;

    #[target_feature(enable = "fma")]
    pub fn simulate(batch: &Batch, response: &mut SimulatedTorque) {
        run::<f64>(batch, response);
    }
}

/// Four trials.
#[cfg(target_arch = "x86_64")]
pub(super) mod four {
    use crate::number::Four;
    use crate::wrist::batch::Batch;
    use crate::wrist::passes::run;
    use crate::wrist::simulation::SimulatedTorque;

    #[target_feature(enable = "avx2,fma")]
    pub fn simulate(batch: &Batch, response: &mut SimulatedTorque) {
        run::<Four>(batch, response);
    }
}

/// Eight trials.
#[cfg(target_arch = "x86_64")]
pub(super) mod eight {
    use crate::number::Eight;
    use crate::wrist::batch::Batch;
    use crate::wrist::passes::run;
    use crate::wrist::simulation::SimulatedTorque;

    #[target_feature(enable = "avx512f,avx512dq,avx512vl,avx512bw,fma")]
    pub fn simulate(batch: &Batch, response: &mut SimulatedTorque) {
        run::<Eight>(batch, response);
    }
}
