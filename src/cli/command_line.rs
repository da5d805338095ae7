//! The program's command line: the verbs, and the exit code.

use std::ffi::OsString;
use std::process::ExitCode;

use clap::{CommandFactory, Parser, Subcommand};

use crate::app::{Console, Failure};

use super::verb::Verb;
use super::{
    attach, calibrate, check, cohort, completions, console, design, diagnose, export, fit, import, new,
    power, replay, report, resume, reveal, rig, run, schedule, schema, sessions, states, trials, verify,
    watch,
};

/// The verbs and the structs of their arguments; clap spells `RigCheck` as `rig-check`.
macro_rules! verbs {
    ($($name:ident($arguments:ty),)*) => {
        #[derive(Debug, Subcommand)]
        enum Verbs {
            $($name($arguments),)*
        }

        impl Verb for Verbs {
            fn run(self, console: &Console) -> Result<(), Failure> {
                match self {
                    $(Self::$name(verb) => verb.run(console),)*
                }
            }
        }
    };
}

verbs! {
    New(new::NewArgs),
    Sessions(sessions::SessionsArgs),
    Console(console::ConsoleArgs),
    Rig(rig::RigArgs),
    Run(run::RunArgs),
    Resume(resume::ResumeArgs),
    Replay(replay::ReplayArgs),
    Watch(watch::WatchArgs),
    Verify(verify::VerifyArgs),
    Check(check::CheckArgs),
    Calibrate(calibrate::CalibrateArgs),
    Import(import::ImportArgs),
    Attach(attach::AttachArgs),
    Trials(trials::TrialsArgs),
    Fit(fit::FitArgs),
    Cohort(cohort::CohortArgs),
    Power(power::PowerArgs),
    Report(report::ReportArgs),
    Export(export::ExportArgs),
    Diagnose(diagnose::DiagnoseArgs),
    Reveal(reveal::RevealArgs),
    Design(design::DesignArgs),
    Schedule(schedule::ScheduleArgs),
    States(states::StatesArgs),
    Schema(schema::SchemaArgs),
}

/// A verb, or completions, which are about all verbs.
#[derive(Debug, Subcommand)]
enum Subcommands {
    #[command(flatten)]
    Verb(Box<Verbs>),
    Completions(completions::CompletionsArgs),
}

/// Ramp-and-hold experiments on the human wrist: run the protocol, fit the model, find what the model gets wrong.
#[derive(Debug, Parser)]
#[command(name = "ramphold", version = VERSION, arg_required_else_help = true, after_help = EXIT_CODES)]
pub struct CommandLine {
    #[command(subcommand)]
    subcommand: Subcommands,
    /// Print results and errors only.
    #[arg(long, global = true, conflicts_with = "verbose")]
    quiet: bool,
    /// Print more messages; -vv prints most.
    #[arg(short, long, global = true, action = clap::ArgAction::Count)]
    verbose: u8,
}

const EXIT_CODES: &str =
    "Exit codes: 0 done; 1 the work failed or was only partly possible; 2 wrong input or usage.";

/// Reads the program's arguments, runs the verb and prints why it failed, if it did.
pub fn main() -> ExitCode {
    ExitCode::from(run_program(std::env::args_os()))
}

/// Runs the program with `arguments`, the first of which is its name; returns the exit code. Once in a process: it sets up the
/// messages of the whole process.
pub fn run_program(arguments: impl IntoIterator<Item = OsString>) -> u8 {
    let command_line = match CommandLine::try_parse_from(arguments) {
        Ok(command_line) => command_line,
        Err(error) => {
            // Where this cannot be printed, nothing can.
            let _ = error.print();
            return u8::try_from(error.exit_code()).unwrap_or(2);
        }
    };
    let console = Console::new(command_line.quiet, command_line.verbose);
    let done = match command_line.subcommand {
        Subcommands::Verb(verb) => verb.run(&console),
        Subcommands::Completions(completions) => completions.print(CommandLine::command(), &console),
    };
    match done {
        Ok(()) => 0,
        Err(failure) => {
            if !failure.is_broken_pipe() {
                console.error(&failure);
            }
            failure.exit_code()
        }
    }
}

/// What `--version` prints: version, commit and optional parts.
pub const VERSION: &str = concat!(
    env!("CARGO_PKG_VERSION"),
    " (commit ",
    env!("RAMPHOLD_BUILT_FROM"),
    "; ",
    env!("RAMPHOLD_FEATURES"),
    ")"
);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_is_well_formed() {
        CommandLine::command().debug_assert();
    }

    #[test]
    fn every_verb_says_what_it_does_and_shows_an_example() {
        for verb in CommandLine::command().get_subcommands() {
            let name = verb.get_name();
            assert!(verb.get_about().is_some(), "{name} has no help");
            let after = verb.get_after_help().map(ToString::to_string).unwrap_or_default();
            assert!(after.contains("ramphold "), "{name} --help shows no example");
        }
    }

    /// `scripts/reference` writes the page.
    #[test]
    fn the_reference_of_the_command_line_is_that_of_the_program() {
        let options = clap_markdown::MarkdownOptions::new()
            .title("Command line".to_owned())
            .show_footer(false)
            .show_table_of_contents(true);
        let page = clap_markdown::help_markdown_command_custom(&CommandLine::command(), &options);
        let page = with_examples_as_code(&page);
        expect_test::expect_file!["../../docs/reference/command-line.md"].assert_eq(&page);
    }

    /// The page with the indented examples of the help as blocks of code.
    fn with_examples_as_code(page: &str) -> String {
        let is_example = |line: &str| line.starts_with("  ramphold ");
        let mut text = String::new();
        let mut in_code = false;
        for line in page.lines() {
            if is_example(line) && !in_code {
                text.push('\n');
            }
            in_code = is_example(line);
            text.push_str(if in_code { "  " } else { "" });
            text.push_str(line);
            text.push('\n');
        }
        text
    }
}
