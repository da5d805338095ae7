//! The files of the pages, embedded in the program.

use rust_embed::RustEmbed;

/// The files of the folder `assets`.
#[derive(RustEmbed)]
#[folder = "src/console/assets/"]
struct Assets;

/// Content type and bytes of a file; `None` if there is no such file.
pub fn file(name: &str) -> Option<(&'static str, Vec<u8>)> {
    let content_type = match name.rsplit_once('.')?.1 {
        "html" => "text/html; charset=utf-8",
        "css" => "text/css; charset=utf-8",
        "js" => "text/javascript; charset=utf-8",
        "svg" => "image/svg+xml",
        _ => return None,
    };
    Some((content_type, Assets::get(name)?.data.into_owned()))
}
