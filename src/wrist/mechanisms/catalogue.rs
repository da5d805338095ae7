//! Turns the list of mechanisms into a type: the only place that leads from an id to code.

/// Declares the mechanisms' modules and [`MechanismKind`], which dispatches to them.
macro_rules! catalogue {
    ($($module:ident :: $name:ident,)*) => {
        $(mod $module;)*

        /// A mechanism of the catalogue.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
        pub enum MechanismKind {
            $(#[doc = concat!("`", stringify!($module), "`")] $name,)*
        }

        /// Every mechanism, in the order of the design's table.
        pub const CATALOGUE: &[MechanismKind] = &[$(MechanismKind::$name,)*];

        impl MechanismKind {
            /// The id that results print.
            pub fn id(self) -> &'static str {
                match self { $(Self::$name => <$module::$name as Mechanism>::ID,)* }
            }

            /// What it is, in a few words.
            pub fn title(self) -> &'static str {
                match self { $(Self::$name => <$module::$name as Mechanism>::TITLE,)* }
            }

            /// Where it acts.
            pub fn class(self) -> MechanismClass {
                match self { $(Self::$name => <$module::$name as Mechanism>::CLASS,)* }
            }

            /// Where its form comes from.
            pub fn source(self) -> &'static str {
                match self { $(Self::$name => <$module::$name as Mechanism>::SOURCE,)* }
            }

            /// Its parameters.
            pub fn parameters(self) -> &'static [MechanismParameter] {
                match self { $(Self::$name => <$module::$name as Mechanism>::PARAMETERS,)* }
            }

            /// What data it needs.
            pub fn needs(self) -> &'static [DataRequirement] {
                match self { $(Self::$name => <$module::$name as Mechanism>::NEEDS,)* }
            }

            /// See [`Mechanism::probes`].
            pub fn probes(self, session: &ProbeContext) -> Vec<Vec<f64>> {
                match self { $(Self::$name => $module::$name::probes(session),)* }
            }

            /// See [`Mechanism::hidden_sizes`].
            pub fn hidden_sizes(self, lever: Option<Lever>) -> Option<(f64, f64)> {
                match self { $(Self::$name => $module::$name::hidden_sizes(lever),)* }
            }

            /// Whether it alters how the recorded angle becomes the motor's.
            pub fn alters_angle(self) -> bool {
                match self { $(Self::$name => <$module::$name as Mechanism>::ALTERS_ANGLE,)* }
            }

            /// Whether there is no law in it that could be another.
            pub fn is_exact(self) -> bool {
                match self { $(Self::$name => <$module::$name as Mechanism>::EXACT,)* }
            }

            /// See [`Mechanism::delay_s`].
            pub fn delay_s(self, p: &[f64]) -> Option<f64> {
                match self { $(Self::$name => $module::$name::delay_s(p),)* }
            }

            /// How long before the onset it may begin to act, s.
            pub fn before_onset_s(self) -> f64 {
                match self { $(Self::$name => <$module::$name as Mechanism>::BEFORE_ONSET_S,)* }
            }

            /// See [`Mechanism::from_the_onset`].
            pub fn from_the_onset(self, p: &mut [f64]) {
                match self { $(Self::$name => $module::$name::from_the_onset(p),)* }
            }

            /// See [`Mechanism::disturbance`].
            pub fn disturbance(self, p: &[f64], session_time_s: f64) -> f64 {
                match self { $(Self::$name => $module::$name::disturbance(p, session_time_s),)* }
            }

            /// How many parameters it has.
            #[inline(always)]
            pub fn parameter_count(self) -> usize {
                match self { $(Self::$name => <$module::$name as Mechanism>::PARAMETERS.len(),)* }
            }

            /// How many states it adds.
            #[inline(always)]
            pub fn memory(self) -> usize {
                match self { $(Self::$name => <$module::$name as Mechanism>::MEMORY,)* }
            }

            /// See [`Mechanism::shape`].
            #[inline(always)]
            pub fn shape<T: Number>(self, p: &[T], plant: &mut Plant<T>, trial: &Covariates<T::Plain>) {
                match self { $(Self::$name => $module::$name::shape(p, plant, trial),)* }
            }

            /// See [`Mechanism::channels`].
            #[inline(always)]
            pub fn channels<T: Number>(self, p: &[T], channels: &mut ChannelErrors<T>) {
                match self { $(Self::$name => $module::$name::channels(p, channels),)* }
            }

            /// See [`Mechanism::act`].
            #[inline(always)]
            pub fn act<T: Number>(
                self,
                p: &[T],
                moment: &Context<'_, T>,
                history: &History<T>,
                slot: usize,
                torques: &mut Torques<T>,
                rates: &mut [T; MEMORY],
            ) {
                match self { $(Self::$name => $module::$name::act(p, moment, history, slot, torques, rates),)* }
            }

            /// See [`Mechanism::measure`].
            #[inline(always)]
            pub fn measure<T: Number>(
                self,
                p: &[T],
                moment: &Context<'_, T>,
                trial: &Covariates<T::Plain>,
                slot: usize,
                torque: T,
                rates: &mut [T; MEMORY],
            ) -> T {
                match self { $(Self::$name => $module::$name::measure(p, moment, trial, slot, torque, rates),)* }
            }
        }
    };
}
