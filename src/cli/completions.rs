//! `ramphold completions`: what a shell needs to complete the command line.

use std::io::Write;

use crate::app::{Console, Failure};

/// Print a script with which a shell completes the verbs, options and values of ramphold.
///
/// Save the script where the shell looks for completions; a new shell then reads it. The Debian package brings the scripts of bash, zsh
/// and fish.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
                        ramphold completions bash > ~/.local/share/bash-completion/completions/ramphold\n  \
                        ramphold completions zsh > ~/.zfunc/_ramphold\n  \
                        ramphold completions fish > ~/.config/fish/completions/ramphold.fish\n\n\
                        zsh reads ~/.zfunc if ~/.zshrc has: fpath+=~/.zfunc; autoload -Uz compinit; compinit")]
pub struct CompletionsArgs {
    /// The shell.
    #[arg(value_enum)]
    shell: clap_complete::Shell,
}

impl CompletionsArgs {
    /// Prints the script for the command line `program`, which no verb knows.
    ///
    /// # Errors
    /// If standard output cannot be written.
    pub fn print(self, mut program: clap::Command, console: &Console) -> Result<(), Failure> {
        let name = program.get_name().to_owned();
        let mut script = Vec::new();
        // Into memory first: the generator panics where it cannot write, such as to a reader that has gone.
        clap_complete::generate(self.shell, &mut program, name, &mut script);
        Ok(console.results().write_all(&script)?)
    }
}
