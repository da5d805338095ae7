//! How fast the fit is: our side of `scripts/bench`, which puts it beside what laboratories use today.
//!
//! ```text
//! fit problem SESSION REFITS       the numbers that everybody fits, as JSON: knots, measured torque, coordinates, start
//! fit plain SESSION STARTS         the plain problems, with other starts
//! fit time FIGURE SESSION STARTS   one figure, the best of several: seconds on the core and by the clock
//! fit memory SESSION               a whole session fitted; the most memory that the process ever held
//! fit operations SESSION           floating-point operations of a simulation, and the processor's multiply-add peak
//! ```

mod bootstrap;
mod operations;
mod peak;
mod problem;
mod watch;

use std::path::Path;

use ramphold::fit::{self, Fit, Model, SessionFit, Weighting};
use ramphold::wrist::{SimulatedTorque, VectorWidth, simulate};
use serde_json::{Value, json};

use problem::{Part, Problem, Starts};
use watch::{best, on_threads, once, peak_bytes};

/// Refits of the bootstrap that is timed, and of the one that is meant.
const REFITS: [usize; 2] = [200, 1000];

/// Trials that go through the model at once where the time of one is wanted.
const TOGETHER: usize = 16;

fn main() {
    let given: Vec<String> = std::env::args().skip(1).filter(|word| word != "--bench").collect();
    let words: Vec<&str> = given.iter().map(String::as_str).collect();
    let answer = match words[..] {
        ["problem", session, refits] => {
            problem(&Problem::read(Path::new(session)), refits.parse().expect("a number of refits"))
        }
        ["plain", session, starts] => {
            plain(&Problem::read(Path::new(session)), &Starts::read(Path::new(starts)))
        }
        ["time", figure, session, starts] => {
            time(figure, &Problem::read(Path::new(session)), &Starts::read(Path::new(starts)))
        }
        ["memory", session] => memory(&Problem::read(Path::new(session))),
        ["operations", session] => operations(&Problem::read(Path::new(session))),
        _ => {
            eprintln!("what is to be measured? See scripts/bench, which calls this program.");
            return;
        }
    };
    println!("{answer}");
}

/// Everything that a peer needs, and what ours makes of it.
fn problem(problem: &Problem, refits: usize) -> Value {
    json!({
        "windows": problem.windows_json(),
        "plain_repetition": problem.plain(&problem.repetition(), None).as_json(),
        "plain_session": problem.plain(&problem.all(), None).as_json(),
        "weighed_repetition": problem.weighed(&problem.repetition()).as_json(),
        "weighed_session": problem.weighed(&problem.all()).as_json(),
        "refits": bootstrap::as_json(problem, refits),
    })
}

/// The plain problems from given starts.
fn plain(problem: &Problem, starts: &Starts) -> Value {
    json!({
        "plain_repetition": problem.plain(&problem.repetition(), Some(&starts.repetition)).as_json(),
        "plain_session": problem.plain(&problem.all(), Some(&starts.session)).as_json(),
    })
}

/// Times one figure of the table.
fn time(figure: &str, problem: &Problem, starts: &Starts) -> Value {
    let six = [0, 1, 2, 3, 4, 5];
    let solved = |part: Part| on_threads(1, || best(|| drop(part.solve())));
    let seconds = match figure {
        "simulation" => one_simulation(problem, TOGETHER, VectorWidth::fastest(), &[]),
        "simulation_alone" => one_simulation(problem, 1, VectorWidth::One, &[]),
        "sensitivities" => one_simulation(problem, TOGETHER, VectorWidth::fastest(), &six),
        "sensitivities_alone" => one_simulation(problem, 1, VectorWidth::One, &six),
        "plain_repetition" => solved(problem.plain(&problem.repetition(), Some(&starts.repetition))),
        "plain_session" => solved(problem.plain(&problem.all(), Some(&starts.session))),
        "weighed_repetition" => solved(problem.weighed(&problem.repetition())),
        "weighed_session" => solved(problem.weighed(&problem.all())),
        "from_nothing" => on_threads(1, || {
            best(|| drop(Fit::new(&problem.prepared, &Model::paper(), Weighting::MeasuredNoise)))
        }),
        "together" => on_threads(1, || {
            best(|| {
                let fit = Fit::new(&problem.prepared, &Model::paper(), Weighting::MeasuredNoise);
                drop(SessionFit::new(&problem.prepared, &fit));
            })
        }),
        "bootstrap" => {
            let refit = || drop(fit::bootstrap(&problem.prepared, &problem.fit, REFITS[0], bootstrap::SEED));
            let some = on_threads(2, || once(refit));
            some.divided_by(REFITS[0] as f64 / REFITS[1] as f64)
        }
        other => panic!("no figure {other}"),
    };
    json!({ "on_core_s": seconds.on_core_s, "clock_s": seconds.clock_s })
}

/// The time of one of `together` trials that go through the model side by side.
fn one_simulation(
    problem: &Problem,
    together: usize,
    width: VectorWidth,
    wanted: &[usize],
) -> watch::Seconds {
    let request = problem.request(width, wanted);
    let trials: Vec<_> = problem.prepared.trials.iter().take(together).map(|trial| &trial.input).collect();
    let parameters: Vec<f64> = problem.start_parameters().into_iter().take(together).flatten().collect();
    let mut response = SimulatedTorque::default();
    let mut run = || simulate(&request, &trials, &parameters, &mut response);
    /// Calls to a measurement, so that reading the clock takes no notable part of it.
    const CALLS: usize = 20;
    let whole = best(|| (0..CALLS).for_each(|_| run()));
    whole.divided_by((CALLS * together) as f64)
}

/// Fits the session and says how much memory that took at most.
fn memory(problem: &Problem) -> Value {
    let solution = problem.weighed(&problem.all()).solve();
    json!({ "peak_bytes": peak_bytes(), "cost": solution.cost() })
}

/// What a simulation with six sensitivities asks of the processor, and what the processor can do.
fn operations(problem: &Problem) -> Value {
    let (plain, with_slopes) = operations::of_a_simulation(problem);
    json!({
        "simulation": plain,
        "sensitivities": with_slopes,
        "multiply_add_peak_per_s": peak::multiply_adds_per_s(),
        "lanes": match VectorWidth::fastest() {
            VectorWidth::One => 1,
            #[cfg(target_arch = "x86_64")]
            VectorWidth::Four => 4,
            #[cfg(target_arch = "x86_64")]
            VectorWidth::Eight => 8,
        },
    })
}
