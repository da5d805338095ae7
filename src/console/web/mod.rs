//! The web pages, served to browsers on this machine or, with a certificate, on the laboratory's network.

mod accept;
mod access_control;
mod address;
mod assets;
mod content;
mod limits;
mod metered;
mod movable_stream;
mod server;
mod site;
mod socket;
#[cfg(all(test, feature = "tls"))]
mod tests;
#[cfg(feature = "tls")]
mod tls;
#[cfg(not(feature = "tls"))]
#[path = "without_tls.rs"]
mod tls;

pub use access_control::{Role, Tokens};
pub use address::Address;
pub use content::{LaboratoryContent, PageContent, PageDisplay, SessionContent};
pub use server::{PageAddresses, Server};
