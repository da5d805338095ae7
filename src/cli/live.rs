//! `--console` and `--tui`: a session that is watched and steered from pages or from the terminal.

use std::net::{IpAddr, SocketAddr};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use clap::ValueEnum;
use ramphold::console::web::Address;
use ramphold::console::{ConsoleSetup, Live, SessionInfo, TrialFitContext, terminal};
use ramphold::dataset::{BackgroundRecorder, Recorder, Trial, Wrist};
use ramphold::fit::PreprocessingSettings;
use ramphold::protocol::ValidProtocol;
use ramphold::rig::Rig;
use ramphold::session::{Clock, Machine, run_control_loop};
use ramphold::wrist::Lever;
use signal_hook::consts::{SIGINT, SIGTERM};

use super::{Console, Failure};

/// How a session is watched and steered.
#[derive(Debug, clap::Args)]
pub struct ConsoleOptions {
    /// Serve a page for the operator, who starts and steers the session there, and one for the person's screen.
    #[arg(long)]
    console: bool,
    /// Watch and steer the session in this terminal.
    #[arg(long)]
    tui: bool,
    /// Pause after the trial when no operator's page was there for so long, s; 0 goes on without.
    #[arg(long, value_name = "S", default_value_t = 10.0)]
    operator_timeout: f64,
    #[command(flatten)]
    pages: PageOptions,
}

/// Where pages are served.
#[derive(Debug, clap::Args)]
pub struct PageOptions {
    /// The port of the pages; the system chooses one if not given.
    #[arg(long, value_name = "N", default_value_t = 0)]
    console_port: u16,
    /// The address of the pages; any but this machine's own needs a certificate.
    #[arg(long, value_name = "ADDR", default_value = "127.0.0.1")]
    listen: IpAddr,
    /// The certificate of the pages, PEM.
    #[arg(long, value_name = "FILE", requires = "tls_key")]
    tls_cert: Option<PathBuf>,
    /// Its private key, PEM.
    #[arg(long, value_name = "FILE", requires = "tls_cert")]
    tls_key: Option<PathBuf>,
    /// A name under which browsers ask for the pages, beside the address itself; can be given more than once.
    #[arg(long, value_name = "NAME")]
    host: Vec<String>,
    /// The wrist in the handle: the person's page is mirrored to its side [default: right].
    #[arg(long, value_enum)]
    wrist: Option<Side>,
}

/// Left or right.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Side {
    /// The left wrist.
    Left,
    /// The right wrist.
    Right,
}

/// What there is to know of a session before it runs.
pub struct Facts<'a> {
    /// Its protocol.
    pub protocol: &'a ValidProtocol,
    /// Who is measured.
    pub subject: &'a str,
    /// The lever of its rig.
    pub lever: Option<Lever>,
    /// What moves the wrist.
    pub rig: &'a str,
    /// Its folder.
    pub folder: &'a Path,
    /// Trials measured already.
    pub earlier: Vec<Trial>,
}

impl PageOptions {
    /// The address, if pages can be served there.
    pub fn address(&self) -> Result<Address, Failure> {
        let address = Address {
            listen: SocketAddr::new(self.listen, self.console_port),
            certificate: self.tls_cert.clone().zip(self.tls_key.clone()),
            hosts: self.host.clone(),
        };
        address.check()?;
        Ok(address)
    }

    /// Which wrist is in the handle, if that was said.
    pub fn wrist(&self) -> Option<Wrist> {
        self.wrist.map(|side| match side {
            Side::Left => Wrist::Left,
            Side::Right => Wrist::Right,
        })
    }

    /// Says where the pages are, and what to mind. Said also when nothing else is: without it, there is no way in.
    pub fn announce(&self, operator: &str, person: &str, console: &Console) {
        if !self.listen.is_loopback() {
            console.announce(format_args!(
                "warning: the pages can be reached from the network; whoever has the operator's address moves the motor"
            ));
        }
        console.announce(format_args!("the operator's page, which steers the session:\n{operator}"));
        console.announce(format_args!("the person's page, which can only look:\n{person}"));
    }
}

impl ConsoleOptions {
    /// Whether there is a console at all, and one that can be opened.
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

    /// The console that was asked for, if one was. `is_patient`: the loop has no deadlines.
    pub fn plan(
        &self,
        facts: Facts,
        starts_at_once: bool,
        is_patient: bool,
    ) -> Result<Option<ConsoleSetup>, Failure> {
        if !self.check()? {
            return Ok(None);
        }
        let protocol = facts.protocol;
        Ok(Some(ConsoleSetup {
            pages: self.console.then(|| self.pages.address()).transpose()?,
            terminal: self.tui,
            wrist: self.pages.wrist().unwrap_or_default(),
            missed_after: (self.operator_timeout > 0.0)
                .then(|| Duration::from_secs_f64(self.operator_timeout)),
            starts_at_once,
            is_patient,
            about: SessionInfo {
                protocol: protocol.name.clone(),
                subject: facts.subject.to_owned(),
                folder: facts.folder.display().to_string(),
                rig: facts.rig.to_owned(),
            },
            circumstances: TrialFitContext {
                subject: facts.subject.to_owned(),
                sample_rate_hz: protocol.signal.sample_rate_hz,
                lever: facts.lever,
                view: PreprocessingSettings { window_s: protocol.window_s, filter: protocol.signal.filter },
            },
            earlier: facts.earlier,
            folder: facts.folder.to_owned(),
        }))
    }

    /// Runs a session with its console until it is over; the console stays open for what is still to be said.
    pub fn conduct<R: Rig>(
        &self,
        plan: ConsoleSetup,
        rig: R,
        machine: &mut Machine,
        clock: &mut impl Clock,
        recorder: Recorder,
        console: &Console,
    ) -> Result<(R, Live), Failure> {
        let stop = stop_on_signals()?;
        let recorder = if plan.is_patient {
            BackgroundRecorder::patient(recorder)
        } else {
            BackgroundRecorder::start(recorder)
        };
        let (mut live, mut tapped, mut listener) = Live::open(plan, machine, recorder, stop)?;
        if let Some(pages) = live.pages() {
            self.pages.announce(&pages.operator, &pages.person, console);
        }
        live.take_terminal()?;
        let ended = run_control_loop(rig, machine, &mut listener, clock, &mut tapped);
        // A disk that failed has already ended the session, and said why.
        let kept = tapped.into_inner().finish();
        live.give_terminal_back();
        let rig = ended?;
        kept?;
        Ok((rig, live))
    }
}

/// What Ctrl-C and the request to end set.
pub fn stop_on_signals() -> Result<Arc<AtomicBool>, Failure> {
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM] {
        signal_hook::flag::register(signal, stop.clone()).map_err(Failure::Signals)?;
    }
    Ok(stop)
}

/// Tells the console, if there is one, how the session came out.
pub fn see_off(live: Option<Live>, folder: &Path, finished: Result<(), Failure>) -> Result<(), Failure> {
    if let Some(live) = live {
        live.close(&match &finished {
            Ok(()) => format!("the results are in {}", folder.join("results").display()),
            Err(failure) => failure.to_string(),
        });
    }
    finished
}
