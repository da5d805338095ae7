//! Pages of the mechanisms: equation, parameters, source, a picture of the effect on the torque, and what imitates it.
//!
//! The effects are those on the average virtual subject in the twelve conditions of the paper. The torque is not filtered and its
//! noise is white, so a projection needs no whitening.

use std::f64::consts::PI;
use std::fmt::Write;

use nalgebra::{DMatrix, DVector};
use ramphold::report::{EffectCurve, mechanism_figure};
use ramphold::wrist::mechanisms::{
    Argument, CATALOGUE, Covariates, DataRequirement, EvidenceSource, LawSpace, MechanismClass,
    MechanismKind, Place, Prior, ProbeContext,
};
use ramphold::wrist::{
    Kinematics, Lever, Plant, SimulatedTorque, SimulationSettings, TrialInput, VectorWidth, simulate,
    substeps,
};

const VELOCITIES_RAD_S: [f64; 4] = [1.3, 1.95, 2.6, 3.25];
const TORQUES_NM: [f64; 3] = [0.9, 1.5, 2.1];
/// Repetitions of each condition in the paper's protocol.
const REPETITIONS: f64 = 3.0;
const PERIOD_S: f64 = 0.0004;
/// Samples of the 40 ms window.
const SAMPLES: usize = 100;
/// Samples before the onset at which the simulation starts, 24 ms.
const LEAD: usize = 60;
/// Samples of the level that is subtracted, 10 ms.
const BASELINE: usize = 25;
const RISE_S: f64 = 0.020;
/// Standard deviation of the gauges' noise in the virtual wrist, N m.
const NOISE_NM: f64 = 0.01;
const LEVER: Lever = Lever { inertia_kg_m2: 0.0016, damping_nm_s_per_rad: 0.4, stiffness_nm_per_rad: 900.0 };
/// Smallest cosine between two mechanisms at which one is said to imitate the other.
const IMITATES: f64 = 0.7;
/// Part of an effect below which what the free parameters leave of it is rounding.
const ABSORBED: f64 = 1e-3;

/// A mechanism's effect on the torque of all conditions, condition after condition, N m.
struct Effect {
    kind: MechanismKind,
    values: Vec<f64>,
    change: DVector<f64>,
    /// What the free parameters cannot absorb.
    residual: DVector<f64>,
}

impl Effect {
    /// Length of a change in standard deviations of the noise of a session.
    fn worth(change: &DVector<f64>) -> f64 {
        change.norm() / NOISE_NM * REPETITIONS.sqrt()
    }

    fn is_absorbed(&self) -> bool {
        self.residual.norm() <= ABSORBED * self.change.norm()
    }

    fn cosine(&self, other: &Self) -> f64 {
        self.residual.dot(&other.residual) / (self.residual.norm() * other.residual.norm())
    }
}

/// The average virtual subject's parameters in a condition, in the order of the base parameters.
fn parameters(velocity_rad_s: f64, torque_nm: f64) -> [f64; 6] {
    let (fast, strong) = (velocity_rad_s - 1.3, torque_nm - 0.9);
    [
        0.005,
        1.2,
        300.0 - 10.0 * fast,
        15.0 + 20.0 / 3.0 * strong,
        9.0 + 1.6 * fast + 3.0 * strong,
        0.0256 + 0.04 / 1.95 * fast - 0.001 * strong,
    ]
}

/// A ramp whose speed rises as a raised cosine, after a second of rest.
fn trial(velocity_rad_s: f64, torque_nm: f64) -> TrialInput {
    let onset = 2500;
    let motion = |sample: usize| {
        let t = (sample as f64 - onset as f64) * PERIOD_S;
        if t <= 0.0 {
            return Kinematics { theta: 0.0, omega: 0.0 };
        }
        let phase = PI * (t / RISE_S).min(1.0);
        let (sine, cosine) = (libm::sin(phase), libm::cos(phase));
        let risen = velocity_rad_s * (t.min(RISE_S) / 2.0 - RISE_S / (2.0 * PI) * sine);
        Kinematics {
            theta: risen + velocity_rad_s * (t - RISE_S).max(0.0),
            omega: velocity_rad_s * (1.0 - cosine) / 2.0,
        }
    };
    // Late in the session, after a short rest, with more activity of both muscles than usual.
    let covariates = Covariates {
        velocity_rad_s,
        torque_before_nm: torque_nm,
        progress: 1.0,
        rest_s: 5.0,
        flexor_emg_excess_mvc: 0.05,
        extensor_emg_mvc: 0.05,
    };
    TrialInput { motion: (0..onset + SAMPLES + 1).map(motion).collect(), onset, covariates }
}

fn conditions() -> Vec<(f64, f64)> {
    VELOCITIES_RAD_S.iter().flat_map(|v| TORQUES_NM.map(|torque| (*v, torque))).collect()
}

/// Torque of all conditions and its derivatives by the base parameters.
fn torque(kinds: &[MechanismKind], values: &[f64]) -> SimulatedTorque {
    let trials: Vec<TrialInput> = conditions().iter().map(|(v, torque)| trial(*v, *torque)).collect();
    let all: Vec<f64> = conditions()
        .iter()
        .flat_map(|(v, torque)| {
            parameters(*v, *torque).into_iter().chain(values.iter().copied()).collect::<Vec<_>>()
        })
        .collect();
    let settings = SimulationSettings {
        lever: Some(LEVER),
        kinds,
        period_s: PERIOD_S,
        samples: SAMPLES,
        lead_samples: LEAD,
        baseline_samples: BASELINE,
        substeps: substeps(&Plant::base(Some(LEVER), &parameters(3.25, 2.1)), f64::INFINITY, PERIOD_S),
        filter: &[],
        further: &[],
        derivatives: &[0, 1, 2, 3, 4, 5],
        width: VectorWidth::fastest(),
    };
    let mut response = SimulatedTorque::default();
    simulate(&settings, &trials.iter().collect::<Vec<_>>(), &all, &mut response);
    response
}

/// Orthonormal basis of what the free parameters can do: I_j in all conditions alike, the others in each condition.
fn absorbable(base: &SimulatedTorque) -> DMatrix<f64> {
    let count = conditions().len();
    let jacobian = DMatrix::from_fn(count * SAMPLES, 1 + 5 * count, |row, column| {
        let slope = |parameter: usize| base.slopes[row * 6 + parameter];
        match column.checked_sub(1) {
            None => slope(0),
            Some(own) if own / 5 == row / SAMPLES => slope(1 + own % 5),
            Some(_) => 0.0,
        }
    });
    let scaled =
        DMatrix::from_columns(&jacobian.column_iter().map(|column| column.normalize()).collect::<Vec<_>>());
    scaled.qr().q()
}

/// The effects of all mechanisms that have parameters, at the first values at which a diagnosis tests them.
fn effects() -> Vec<Effect> {
    let base = torque(&[], &[]);
    let basis = absorbable(&base);
    let highest = base.torque_nm.iter().copied().fold(0.0, f64::max) + TORQUES_NM[2];
    let context = ProbeContext { lever: Some(LEVER), highest_torque_nm: highest, window_s: 0.04 };
    let effect = |kind: MechanismKind| {
        let values = kind.probes(&context).into_iter().next().unwrap_or_default();
        let with = torque(&[kind], &values);
        let change = DVector::from_fn(base.torque_nm.len(), |row, _| {
            let added = kind.disturbance_nm(&values, (row % SAMPLES) as f64 * PERIOD_S);
            with.torque_nm[row] - base.torque_nm[row] + added
        });
        let residual = &change - &basis * basis.tr_mul(&change);
        Effect { kind, values, change, residual }
    };
    let kinds = CATALOGUE.iter().copied().filter(|kind| kind.parameter_count() > 0);
    kinds.map(effect).collect()
}

/// Unit of a parameter, which ends its name.
fn unit(name: &str) -> &'static str {
    const UNITS: [(&str, &str); 12] = [
        ("_nm_per_rad_per_mvc", "N m/rad per MVC"),
        ("_nm_s_per_rad", "N m s/rad"),
        ("_nm_per_rad", "N m/rad"),
        ("_nm_per_s", "N m/s"),
        ("_per_rad2", "1/rad²"),
        ("_per_rad", "1/rad"),
        ("_per_nm", "1/(N m)"),
        ("_kg_m2", "kg m²"),
        ("_rad", "rad"),
        ("_nm", "N m"),
        ("_hz", "Hz"),
        ("_s", "s"),
    ];
    UNITS.iter().find(|(suffix, _)| name.ends_with(suffix)).map_or("1", |(_, unit)| unit)
}

fn class(kind: MechanismKind) -> &'static str {
    match kind.class() {
        MechanismClass::Plant => "`plant`: it acts in the wrist",
        MechanismClass::Rig => "`rig`: it acts in the lever or the motor",
        MechanismClass::Sensor => "`sensor`: it acts in the sensors",
        MechanismClass::Trial => "`trial`: it acts from trial to trial",
    }
}

fn evidence(kind: MechanismKind) -> &'static str {
    match kind.evidence() {
        EvidenceSource::Trace => "in the torque within the trials",
        EvidenceSource::AcrossTrials => "in how k_srs differs between trials",
        EvidenceSource::Hold => "in the hold before the ramp",
        EvidenceSource::LimitLaw => "in how the elastic limit depends on velocity and torque",
        EvidenceSource::SingleTrials => "in single trials that differ from their repetitions",
    }
}

fn need(need: DataRequirement) -> &'static str {
    match need {
        DataRequirement::Lever => "a compliant lever",
        DataRequirement::FlexorEmg => "EMG of the flexor that varies between trials",
        DataRequirement::ExtensorEmg => "EMG of the extensor that varies between trials",
        DataRequirement::Rest => "a rest before the trials that varies between them",
        DataRequirement::Velocities => "trials at more than one velocity",
    }
}

fn page(kind: MechanismKind, effects: &[Effect]) -> String {
    let mut page = format!("# {}\n\n{}.\n\n", kind.id(), capitalised(kind.title()));
    let needs: Vec<&str> = kind.needs().iter().map(|requirement| need(*requirement)).collect();
    let needs =
        if needs.is_empty() { "nothing beyond angle and torque".to_owned() } else { needs.join("; ") };
    let _ = write!(
        page,
        "| | |\n|---|---|\n| equation | `{}` |\n| class | {} |\n| shown | {} |\n| needs | {needs} |\n| source | {} |\n| place | {} |\n| law | {} |\n",
        kind.equation().replace('|', "\\|"),
        class(kind),
        evidence(kind),
        kind.source(),
        place(kind.law_space().place),
        law(kind.law_space()),
    );
    parameters_table(&mut page, kind);
    if let Some(effect) = effects.iter().find(|effect| effect.kind == kind) {
        describe(&mut page, effect, effects);
    }
    page.push_str("\n[All mechanisms](index.md); [how to read this page](index.md#how-to-read-a-page)\n");
    page
}

fn parameters_table(page: &mut String, kind: MechanismKind) {
    if kind.parameter_count() == 0 {
        page.push_str("\nIt has no parameters.\n");
        return;
    }
    page.push_str(
        "\n| parameter | meaning | unit | bounds | no effect at | typical | prior |\n|---|---|---|---|---|---|---|\n",
    );
    for (place, parameter) in kind.parameters().iter().enumerate() {
        let is_law = place + 1 == kind.parameter_count() && !kind.laws().is_empty();
        let absent = parameter.absent.map(|value| value.to_string());
        let absent = absent.unwrap_or_else(|| if is_law { "none" } else { "a limit only" }.to_owned());
        let laws: Vec<String> = kind.laws().iter().map(f64::to_string).collect();
        let prior =
            if is_law { format!("{}, equally probable", laws.join(" or ")) } else { prior(parameter.prior) };
        let _ = writeln!(
            page,
            "| `{}` | {} | {} | {} to {} | {absent} | {} | {} |",
            parameter.name,
            parameter.meaning,
            unit(parameter.name),
            parameter.low,
            parameter.high,
            parameter.typical,
            prior
        );
    }
    let _ = writeln!(page, "\nSource of the priors: {}.", kind.prior_source());
}

fn prior(prior: Prior) -> String {
    match prior {
        Prior::Normal { mean, sd } => format!("normal, mean {mean}, sd {sd}"),
        Prior::HalfNormal { sd } => format!("half-normal above no effect, sd {sd}"),
        Prior::LogNormal { median, log_sd } => format!("log-normal, median {median}, sd of ln {log_sd}"),
    }
}

fn place(place: Place) -> &'static str {
    match place {
        Place::Joint => "`joint`: the torque in the joint",
        Place::Interface => "`interface`: the torque between handle and hand",
        Place::Handle => "`handle`: the torque in the lever",
        Place::TorqueChannel => "`torque_channel`: the torque channel",
        Place::AngleChannel => "`angle_channel`: the angle channel",
        Place::Trials => "`trials`: the differences between trials",
    }
}

fn law(space: LawSpace) -> String {
    let argument = match space.argument {
        None => return "certain: the mechanism has no law of uncertain form".to_owned(),
        Some(Argument::Angle) => "the angle",
        Some(Argument::Speed) => "the speed",
        Some(Argument::AngleBeyondYield) => "the joint angle beyond the elastic limit",
        Some(Argument::Time) => "the time since the onset",
        Some(Argument::PastSpeed) => "past speed",
        Some(Argument::Deflection) => "the deflection between hand and handle",
        Some(Argument::Torque) => "the torque",
        Some(Argument::PastTorque) => "past torque",
    };
    format!(
        "a function of {argument}; the real law differs from the equation by {:.0} % (standard deviation)",
        space.sd * 100.0
    )
}

fn describe(page: &mut String, effect: &Effect, effects: &[Effect]) {
    let values = effect.kind.parameters().iter().zip(&effect.values);
    let values: Vec<String> = values
        .map(|(parameter, value)| format!("`{}` = {}", parameter.name, (value * 1e6).round() / 1e6))
        .collect();
    let _ = write!(
        page,
        "\n## Effect on the torque\n\n![Change of the torque by {id}, before and after the free parameters follow]({id}.svg)\n\n\
         At {}. In a session of the paper's size the change is worth {:.1} standard deviations of the noise, and {:.1} after \
         the free parameters have absorbed what they can.\n\n## What imitates it\n\n",
        values.join(", "),
        Effect::worth(&effect.change),
        Effect::worth(&effect.residual),
        id = effect.kind.id(),
    );
    if effect.kind.evidence() != EvidenceSource::Trace {
        let _ = writeln!(
            page,
            "The program looks for it {}, not in the residuals within the trials, so it has no cosine with other mechanisms.",
            evidence(effect.kind)
        );
        return;
    }
    if effect.is_absorbed() {
        page.push_str("Nothing is left of it to compare: the free parameters absorb all of it.\n");
        return;
    }
    let mut rivals: Vec<(f64, MechanismKind)> = effects
        .iter()
        .filter(|other| {
            other.kind != effect.kind
                && other.kind.evidence() == EvidenceSource::Trace
                && !other.is_absorbed()
        })
        .map(|other| (effect.cosine(other), other.kind))
        .filter(|(cosine, _)| cosine.abs() >= IMITATES)
        .collect();
    rivals.sort_by(|a, b| b.0.abs().total_cmp(&a.0.abs()));
    if rivals.is_empty() {
        let _ = writeln!(page, "No other mechanism has a cosine of {IMITATES} or more with it.");
        return;
    }
    page.push_str("| mechanism | cosine |\n|---|---|\n");
    for (cosine, kind) in rivals {
        let _ = writeln!(page, "| [{id}]({id}.md) | {cosine:+.2} |", id = kind.id());
    }
}

fn capitalised(text: &str) -> String {
    let mut characters = text.chars();
    characters.next().map_or_else(String::new, |first| first.to_uppercase().chain(characters).collect())
}

fn picture(effect: &Effect) -> String {
    let curves = |change: &DVector<f64>| -> Vec<EffectCurve> {
        conditions()
            .iter()
            .enumerate()
            .filter(|(_, (_, torque))| *torque == TORQUES_NM[1])
            .map(|(condition, (velocity, _))| EffectCurve {
                label: format!("{velocity} rad/s"),
                points: (0..SAMPLES)
                    .map(|sample| {
                        (sample as f64 * PERIOD_S * 1e3, change[condition * SAMPLES + sample] * 1e3)
                    })
                    .collect(),
            })
            .collect()
    };
    mechanism_figure(effect.kind.id(), &curves(&effect.change), &curves(&effect.residual))
}

fn index(effects: &[Effect]) -> String {
    let mut page = "# Mechanisms

A mechanism is a named addition to the [base model](../../explanation/model.md). `run --model`, `fit --model` and `diagnose` know the mechanisms below by their ids. \
These pages are generated from the code.

| mechanism | description | class | shown | worth | after absorption |
|---|---|---|---|---|---|
"
    .to_owned();
    for kind in CATALOGUE.iter().copied() {
        let worth = effects.iter().find(|effect| effect.kind == kind).map_or_else(
            || ("-".to_owned(), "-".to_owned()),
            |effect| {
                (
                    format!("{:.1}", Effect::worth(&effect.change)),
                    format!("{:.1}", Effect::worth(&effect.residual)),
                )
            },
        );
        let class = class(kind);
        let class = class.split(':').next().unwrap_or(class);
        let _ = writeln!(
            page,
            "| [{id}]({id}.md) | {} | {class} | {} | {} | {} |",
            kind.title(),
            evidence(kind),
            worth.0,
            worth.1,
            id = kind.id()
        );
    }
    page.push_str(
        "
What no mechanism describes can be described by a [free law](free-laws.md), an unknown function at a place of the model.

## How to read a page

- **Equation.** `x'` is the rate of x; `x += y` adds y to a torque of [Eq. 3-7](../../explanation/model.md). The other symbols are in the [glossary](../glossary.md#the-model-eq-1-7).
- **Bounds** are those of the fit. *No effect at* is the value at which the mechanism is absent.
- **Prior** says what is held plausible of a parameter before any data. *Law* says how far the real law may differ from the equation. Both were declared before any \
benchmark was run. A prior about a value that the session states is shown for typical values.
- **Picture.** The change of the torque of the average virtual subject at 1.5 N m, at the values stated: on the left with all other parameters fixed, on the right after I_j (in all \
conditions alike) and b_h, k_h, k_srs, k_dec and x_e (in each condition) have followed to first order. What is on the right is what a diagnosis can see. Mechanisms that \
depend on the trial are shown for the last trial, after a rest of 5 s, with 0.05 MVC more EMG than usual.
- **Worth** is the length of the change in standard deviations of the noise, over a session of the paper's size (12 conditions, 3 repetitions, 40 ms, 2500 samples a second), with white \
noise of 0.01 N m and without filter. Wander, tremor and encoder steps, which this leaves out, make real worths smaller. [Half sizes](../../benchmarks/half-sizes.md) are counted on whole sessions.
- **What imitates it.** The cosine between what remains of two mechanisms: near +1 or -1 the session does not distinguish them, and a diagnosis names both. The sign says whether one acts like the \
other or like its opposite. All cosines of 0.7 and more are listed.

[The diagnosis](../../explanation/diagnosis.md) explains how the program uses this. [Half sizes](../../benchmarks/half-sizes.md) and [the benchmark](../../benchmarks/hidden-effects.md) say what it finds.
",
    );
    page
}

#[test]
fn the_pages_of_the_mechanisms_are_those_of_the_catalogue() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/docs/reference/mechanisms");
    let contents = include_str!("../../../docs/SUMMARY.md");
    let effects = effects();
    for kind in CATALOGUE.iter().copied() {
        let link = format!("(reference/mechanisms/{}.md)", kind.id());
        assert!(contents.contains(&link), "docs/SUMMARY.md must name the page {link}");
        compare(&format!("{folder}/{}.md", kind.id()), &page(kind, &effects));
    }
    for effect in &effects {
        compare(&format!("{folder}/{}.svg", effect.kind.id()), &picture(effect));
    }
    compare(&format!("{folder}/index.md"), &index(&effects));
}

fn compare(path: &str, text: &str) {
    expect_test::ExpectFile { path: path.into(), position: file!() }.assert_eq(text);
}
