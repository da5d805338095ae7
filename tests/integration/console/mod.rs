//! The console from outside: a browser's requests, and those of somebody who should not be there.

mod audit;
mod laboratory;
mod program;
mod security;
mod steering;
#[cfg(feature = "terminal")]
mod terminal;
#[cfg(feature = "tls")]
mod tls;
mod watch;
