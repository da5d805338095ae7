//! Options of the console: `--console` and `--tui`, and where the pages are served.

use std::net::{IpAddr, SocketAddr};
use std::path::{Path, PathBuf};
use std::time::Duration;

use crate::console::web::{Address, PageDisplay};
use crate::console::{
    CommandQuestions, ConsoleSetup, PageAddresses, Pages, SessionInfo, TrialFitContext, terminal,
};
use crate::dataset::{Trial, Wrist};
use crate::fit::PreprocessingSettings;
use crate::protocol::ValidProtocol;
use crate::signal::FilterSpec;
use crate::wrist::Lever;
use clap::ValueEnum;

use super::{Console, Failure};

/// Options of the operator's console.
#[derive(Debug, clap::Args)]
pub struct ConsoleOptions {
    /// Serve web pages: one where the operator starts and controls the session, one for the subject's screen.
    #[arg(long)]
    console: bool,
    /// Watch and control the session in this terminal.
    #[arg(long)]
    tui: bool,
    /// Pause after the trial when no operator's page has been open for this time, s; 0 never pauses.
    #[arg(long, value_name = "S", default_value_t = 10.0)]
    operator_timeout: f64,
    /// Options of the web pages.
    #[command(flatten)]
    pub(crate) pages: PageOptions,
    /// Pages that are there before and after the session, in place of its own.
    #[arg(skip)]
    display: Option<PageDisplay>,
}

/// Options of the web pages.
#[derive(Debug, Clone, clap::Args)]
pub struct PageOptions {
    /// Port of the pages [default: a free port].
    #[arg(long, value_name = "N", default_value_t = 0)]
    console_port: u16,
    /// Address of the pages; an address other than this machine's own needs a certificate.
    #[arg(long, value_name = "ADDR", default_value = "127.0.0.1")]
    listen: IpAddr,
    /// Certificate of the pages, PEM file.
    #[arg(long, value_name = "FILE", requires = "tls_key")]
    tls_cert: Option<PathBuf>,
    /// Private key of the certificate, PEM file.
    #[arg(long, value_name = "FILE", requires = "tls_cert")]
    tls_key: Option<PathBuf>,
    /// Host name that browsers may use for the pages, beside the address; can be repeated.
    #[arg(long, value_name = "NAME")]
    host: Vec<String>,
    /// Wrist in the handle; the subject's page is mirrored to its side [default: right].
    #[arg(long, value_enum)]
    wrist: Option<Side>,
}

/// Left or right wrist.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Side {
    /// The left wrist.
    Left,
    /// The right wrist.
    Right,
}

/// What the console must know of a session before it runs.
pub struct SessionDescription<'a> {
    /// Protocol of the session.
    pub protocol: &'a ValidProtocol,
    /// Identifier of the subject.
    pub subject: &'a str,
    /// Lever of the rig.
    pub lever: Option<Lever>,
    /// Filter that angle and torque pass before they are recorded.
    pub recorded_filter: Option<FilterSpec>,
    /// Name of the rig.
    pub rig: &'a str,
    /// What the operator is asked before commands of this rig.
    pub questions: CommandQuestions,
    /// The session's folder.
    pub folder: &'a Path,
    /// Trials measured before the session was resumed.
    pub earlier_trials: Vec<Trial>,
}

impl PageOptions {
    /// Address of the pages, checked.
    pub fn address(&self) -> Result<Address, Failure> {
        let address = Address {
            listen: SocketAddr::new(self.listen, self.console_port),
            certificate: self.tls_cert.clone().zip(self.tls_key.clone()),
            hosts: self.host.clone(),
        };
        address.check()?;
        Ok(address)
    }

    /// The same options with this wrist in the handle, if it is known.
    #[must_use]
    pub fn with_wrist(mut self, wrist: Option<Wrist>) -> Self {
        let side = wrist.map(|wrist| match wrist {
            Wrist::Left => Side::Left,
            Wrist::Right => Side::Right,
        });
        self.wrist = side.or(self.wrist);
        self
    }

    /// Wrist in the handle, if the option was given.
    pub fn wrist(&self) -> Option<Wrist> {
        self.wrist.map(|side| match side {
            Side::Left => Wrist::Left,
            Side::Right => Wrist::Right,
        })
    }

    /// Prints the addresses of the pages, also with `--quiet`: they are the only way to the pages.
    pub fn announce(&self, pages: &PageAddresses, console: &Console) {
        if !self.listen.is_loopback() {
            console.announce(format_args!(
                "warning: the pages can be reached from the network; whoever has the operator's address can move the motor"
            ));
        }
        console
            .announce(format_args!("the operator's page, which controls the session:\n{}", pages.operator));
        console.announce(format_args!("the subject's page, without controls:\n{}", pages.subject));
    }
}

impl ConsoleOptions {
    /// A console in pages that are there before and after the session.
    pub fn on_display(pages: PageOptions, operator_timeout_s: f64, display: PageDisplay) -> Self {
        Self {
            console: true,
            tui: false,
            operator_timeout: operator_timeout_s,
            pages,
            display: Some(display),
        }
    }

    /// Checks the options; returns whether there is a console.
    ///
    /// # Errors
    /// If an option has no valid value.
    pub fn check(&self) -> Result<bool, Failure> {
        if !(0.0..=1e6).contains(&self.operator_timeout) {
            let given = self.operator_timeout;
            return Err(Failure::Usage(format!("--operator-timeout {given}: expected seconds, at least 0")));
        }
        self.pages.address()?;
        if self.tui {
            terminal::check()?;
        }
        Ok(self.console || self.tui)
    }

    /// The console that the options ask for; `None` without a console. With `may_wait` the control loop has no deadlines.
    pub fn setup(
        &self,
        session: SessionDescription,
        starts_at_once: bool,
        may_wait: bool,
    ) -> Result<Option<ConsoleSetup>, Failure> {
        if !self.check()? {
            return Ok(None);
        }
        let protocol = session.protocol;
        Ok(Some(ConsoleSetup {
            pages: match &self.display {
                _ if !self.console => None,
                Some(display) => Some(Pages::Of(display.clone())),
                None => Some(Pages::Own(self.pages.address()?)),
            },
            terminal: self.tui,
            wrist: self.pages.wrist().unwrap_or_default(),
            missed_after: (self.operator_timeout > 0.0)
                .then(|| Duration::from_secs_f64(self.operator_timeout)),
            starts_at_once,
            may_wait,
            questions: session.questions,
            info: SessionInfo {
                protocol: protocol.name.clone(),
                subject: session.subject.to_owned(),
                folder: session.folder.display().to_string(),
                rig: session.rig.to_owned(),
            },
            fit_context: TrialFitContext {
                subject: session.subject.to_owned(),
                sample_rate_hz: protocol.signal.sample_rate_hz,
                lever: session.lever,
                recorded_filter: session.recorded_filter,
                preprocessing: PreprocessingSettings::of(protocol),
            },
            earlier_trials: session.earlier_trials,
            folder: session.folder.to_owned(),
        }))
    }
}
