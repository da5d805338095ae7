//! The macro that turns the list of mechanisms into a type: the only code that leads from an identifier to a mechanism.

/// Declares the mechanisms' modules, [`MechanismKind`], which dispatches to them, and the number of states that they add. An entry may
/// have a condition (`#[cfg(test)]`).
macro_rules! catalogue {
    ($($(#[$condition:meta])? $module:ident :: $name:ident,)*) => {
        $($(#[$condition])? mod $module;)*

        /// A mechanism of the catalogue, or a free law.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
        pub enum MechanismKind {
            $($(#[$condition])? #[doc = concat!("`", stringify!($module), "`")] $name,)*
            /// An unknown function, which is not in the catalogue.
            Free(FreeLawKind),
        }

        /// Every named mechanism, in the order of the catalogue.
        pub const CATALOGUE: &[MechanismKind] = &[$($(#[$condition])? MechanismKind::$name,)*];

        /// Number of states that a model can add: those of all mechanisms and free laws, each switched on once.
        pub const MAX_ADDED_STATES: usize = {
            let states: &[usize] = &[$($(#[$condition])? <$module::$name as Mechanism>::STATES,)*];
            let (mut sum, mut place) = (0, 0);
            while place < states.len() {
                sum += states[place];
                place += 1;
            }
            sum + FreeLawKind::JointPastSpeed.state_count() + FreeLawKind::TorqueChannelPastTorque.state_count()
        };

        /// Number of states that one mechanism can have in the torque channel.
        pub const MAX_CHANNEL_STATES: usize = {
            let states: &[usize] = &[$($(#[$condition])? if <$module::$name as Mechanism>::ADDS_TORQUE { 0 } else { <$module::$name as Mechanism>::STATES },)*];
            let (mut most, mut place) = (FreeLawKind::TorqueChannelPastTorque.state_count(), 0);
            while place < states.len() {
                if states[place] > most {
                    most = states[place];
                }
                place += 1;
            }
            most
        };

        impl MechanismKind {
            /// Identifier in results and model files.
            pub fn id(self) -> &'static str {
                match self { $($(#[$condition])? Self::$name => <$module::$name as Mechanism>::ID,)* Self::Free(law) => law.id() }
            }

            /// Description in a few words.
            pub fn title(self) -> &'static str {
                match self { $($(#[$condition])? Self::$name => <$module::$name as Mechanism>::TITLE,)* Self::Free(law) => law.title() }
            }

            /// Where it acts.
            pub fn class(self) -> MechanismClass {
                match self { $($(#[$condition])? Self::$name => <$module::$name as Mechanism>::CLASS,)* Self::Free(law) => law.class() }
            }

            /// Where a session shows it.
            pub fn evidence(self) -> EvidenceSource {
                match self { $($(#[$condition])? Self::$name => <$module::$name as Mechanism>::EVIDENCE,)* Self::Free(_) => EvidenceSource::Trace }
            }

            /// Its equation in plain text; notation of [`Mechanism::EQUATION`].
            pub fn equation(self) -> &'static str {
                match self { $($(#[$condition])? Self::$name => <$module::$name as Mechanism>::EQUATION,)* Self::Free(law) => law.equation() }
            }

            /// Source of its functional form.
            pub fn source(self) -> &'static str {
                match self { $($(#[$condition])? Self::$name => <$module::$name as Mechanism>::SOURCE,)* Self::Free(_) => "Cubic B-splines, or lags that span a memory (de Boor 1978)" }
            }

            /// Source of the priors of its parameters.
            pub fn prior_source(self) -> &'static str {
                match self { $($(#[$condition])? Self::$name => <$module::$name as Mechanism>::PRIOR_SOURCE,)* Self::Free(_) => "A placeholder: a diagnosis sets the spread from the session" }
            }

            /// Where it acts, and how far its real law may differ from its equation.
            pub fn law_space(self) -> LawSpace {
                match self { $($(#[$condition])? Self::$name => <$module::$name as Mechanism>::LAW_SPACE,)* Self::Free(law) => law.law_space() }
            }

            /// Standard deviation of the relative change of its size with the torque of the trials; see [`Mechanism::TORQUE_SCALING_SD`].
            pub fn torque_scaling_sd(self) -> f64 {
                match self { $($(#[$condition])? Self::$name => <$module::$name as Mechanism>::TORQUE_SCALING_SD,)* Self::Free(_) => SIZE_DRIFT_SD }
            }

            /// Its parameters.
            pub fn parameters(self) -> &'static [MechanismParameter] {
                match self { $($(#[$condition])? Self::$name => <$module::$name as Mechanism>::PARAMETERS,)* Self::Free(law) => law.parameters() }
            }

            /// Data that a session must hold.
            pub fn needs(self) -> &'static [DataRequirement] {
                match self { $($(#[$condition])? Self::$name => <$module::$name as Mechanism>::NEEDS,)* Self::Free(law) => law.needs() }
            }

            /// Whether it alters how the recorded angle becomes the motor's.
            pub fn alters_angle(self) -> bool {
                match self { $($(#[$condition])? Self::$name => <$module::$name as Mechanism>::ALTERS_ANGLE,)* Self::Free(law) => matches!(law, FreeLawKind::AngleChannelAngle) }
            }

            /// Whether it asks for its states at past times.
            pub fn reads_past(self) -> bool {
                match self { $($(#[$condition])? Self::$name => <$module::$name as Mechanism>::READS_PAST,)* Self::Free(law) => matches!(law, FreeLawKind::JointPastSpeed) }
            }

            /// Whether its torque sets in as sharply as the yield.
            pub fn follows_yield(self) -> bool {
                match self { $($(#[$condition])? Self::$name => <$module::$name as Mechanism>::FOLLOWS_YIELD,)* Self::Free(law) => matches!(law, FreeLawKind::JointAngleBeyondYield) }
            }

            /// Whether it adds torques to Eq. 3-7.
            pub fn adds_torque(self) -> bool {
                match self { $($(#[$condition])? Self::$name => <$module::$name as Mechanism>::ADDS_TORQUE,)* Self::Free(law) => matches!(law.place(), Place::Joint | Place::Interface | Place::Handle) }
            }

            /// Whether it alters more of the plant than k_dec, x_e and a_s.
            pub fn alters_linear_part(self) -> bool {
                match self { $($(#[$condition])? Self::$name => <$module::$name as Mechanism>::ALTERS_LINEAR_PART,)* Self::Free(_) => false }
            }

            /// Number of states that it has in the torque channel, which move nothing.
            #[inline(always)]
            pub fn channel_state_count(self) -> usize {
                if self.adds_torque() { 0 } else { self.state_count() }
            }

            /// How long before the onset it may begin to act, s.
            pub fn before_onset_s(self) -> f64 {
                match self { $($(#[$condition])? Self::$name => <$module::$name as Mechanism>::BEFORE_ONSET_S,)* Self::Free(_) => 0.0 }
            }

            /// Index of the parameter that is the frequency (Hz) of a sinusoid to subtract before a fit.
            pub fn subtracted_frequency(self) -> Option<usize> {
                match self { $($(#[$condition])? Self::$name => <$module::$name as Mechanism>::SUBTRACTED_FREQUENCY,)* Self::Free(_) => None }
            }

            /// Values of its last parameter for which its law is compared; see [`Mechanism::LAWS`].
            pub fn laws(self) -> &'static [f64] {
                match self { $($(#[$condition])? Self::$name => <$module::$name as Mechanism>::LAWS,)* Self::Free(_) => &[] }
            }

            /// Starting value of a fit for parameter number `parameter`, in a rig with this lever.
            pub fn starting_value(self, parameter: usize, lever: Option<Lever>) -> f64 {
                match self { $($(#[$condition])? Self::$name => $module::$name::starting_value(parameter, lever),)* Self::Free(law) => law.starting_value(parameter) }
            }

            /// Prior of parameter number `parameter` in this session.
            pub fn prior(self, parameter: usize, session: &ProbeContext) -> Prior {
                match self { $($(#[$condition])? Self::$name => $module::$name::prior(parameter, session),)* Self::Free(law) => law.parameters()[parameter].prior }
            }

            /// Parameter values at which a diagnosis tests whether the mechanism would help.
            pub fn probes(self, session: &ProbeContext) -> Vec<Vec<f64>> {
                match self { $($(#[$condition])? Self::$name => $module::$name::probes(session),)* Self::Free(law) => vec![law.parameters().iter().map(|parameter| parameter.typical).collect()] }
            }

            /// Range of the first parameter when hidden; see [`Mechanism::hidden_range`].
            pub fn hidden_range(self, lever: Option<Lever>) -> Option<(f64, f64)> {
                match self { $($(#[$condition])? Self::$name => $module::$name::hidden_range(lever),)* Self::Free(_) => None }
            }

            /// Moves the start of an effect that begins before the onset to the onset.
            pub fn start_at_onset(self, p: &mut [f64]) {
                match self { $($(#[$condition])? Self::$name => $module::$name::start_at_onset(p),)* Self::Free(_) => {} }
            }

            /// Lags at which its law of the past may differ from the catalogued one, s; see [`Mechanism::law_lags_s`].
            pub fn law_lags_s(self, p: &[f64]) -> Option<[f64; 2]> {
                match self { $($(#[$condition])? Self::$name => $module::$name::law_lags_s(p),)* Self::Free(_) => None }
            }

            /// The longest step of an integration that its states allow, s, where the motor turns at up to `speed_rad_s`.
            pub fn longest_step_s(self, p: &[f64], speed_rad_s: f64) -> f64 {
                match self { $($(#[$condition])? Self::$name => $module::$name::longest_step_s(p, speed_rad_s),)* Self::Free(law) => law.longest_step_s(p) }
            }

            /// Torque that the torque channel shows in addition, N m.
            pub fn disturbance_nm(self, p: &[f64], session_time_s: f64) -> f64 {
                match self { $($(#[$condition])? Self::$name => $module::$name::disturbance_nm(p, session_time_s),)* Self::Free(_) => 0.0 }
            }

            /// Number of its parameters.
            #[inline(always)]
            pub fn parameter_count(self) -> usize {
                match self { $($(#[$condition])? Self::$name => <$module::$name as Mechanism>::PARAMETERS.len(),)* Self::Free(law) => law.parameter_count() }
            }

            /// Number of states that it adds.
            #[inline(always)]
            pub fn state_count(self) -> usize {
                match self { $($(#[$condition])? Self::$name => <$module::$name as Mechanism>::STATES,)* Self::Free(law) => law.state_count() }
            }

            /// Alters the coefficients of the plant in a trial.
            #[inline(always)]
            pub fn alter_plant<T: Number>(self, p: &[T], plant: &mut Plant<T>, trial: &Covariates<T::Plain>) {
                match self { $($(#[$condition])? Self::$name => $module::$name::alter_plant(p, plant, trial),)* Self::Free(_) => {} }
            }

            /// Alters how the recorded angle becomes the motor's angle.
            #[inline(always)]
            pub fn alter_channels<T: Number>(self, p: &[T], channels: &mut ChannelErrors<T>) {
                match self { $($(#[$condition])? Self::$name => $module::$name::alter_channels(p, channels),)* Self::Free(law) => law.alter_channels(p, channels) }
            }

            /// Adds torques and writes the rates of its states.
            #[inline(always)]
            pub fn add_torques<T: Number>(
                self,
                p: &[T],
                context: &Context<'_, T>,
                states: &OwnStates<'_, T>,
                torques: &mut Torques<T>,
                rates: &mut [T],
            ) {
                match self { $($(#[$condition])? Self::$name => $module::$name::add_torques(p, context, states, torques, rates),)* Self::Free(law) => law.add_torques(p, context, states, torques, rates) }
            }

            /// Alters the measured torque, `time_s` after the onset, and writes the rates of its states.
            #[inline(always)]
            #[allow(clippy::too_many_arguments)]
            pub fn alter_measurement<T: Number>(
                self,
                p: &[T],
                states: &OwnStates<'_, T>,
                trial: &Covariates<T::Plain>,
                time_s: f64,
                torque: T,
                rates: &mut [T],
            ) -> T {
                match self { $($(#[$condition])? Self::$name => $module::$name::alter_measurement(p, states, trial, torque, rates),)* Self::Free(law) => law.alter_measurement(p, states, trial, time_s, torque, rates) }
            }
        }
    };
}
