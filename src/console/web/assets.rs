//! The files of the pages, which are in the program.

use rust_embed::RustEmbed;

/// Everything in the folder `assets`.
#[derive(RustEmbed)]
#[folder = "src/console/assets/"]
struct Assets;

/// A file and its type, if there is one of that name.
pub fn file(name: &str) -> Option<(&'static str, Vec<u8>)> {
    let kind = match name.rsplit_once('.')?.1 {
        "html" => "text/html; charset=utf-8",
        "css" => "text/css; charset=utf-8",
        "js" => "text/javascript; charset=utf-8",
        "svg" => "image/svg+xml",
        _ => return None,
    };
    Some((kind, Assets::get(name)?.data.into_owned()))
}
