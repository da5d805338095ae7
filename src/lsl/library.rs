//! `liblsl`, loaded at run time: the functions that are called, and what they are called with.

use std::ffi::{CString, c_char, c_double, c_int, c_ulong, c_void};
use std::path::{Path, PathBuf};

use libloading::{Library, Symbol};

/// Names under which the library is looked for.
const NAMES: [&str; 2] = if cfg!(target_os = "windows") {
    ["lsl.dll", "liblsl64.dll"]
} else if cfg!(target_os = "macos") {
    ["liblsl.dylib", "/opt/homebrew/lib/liblsl.dylib"]
} else {
    ["liblsl.so", "liblsl.so.2"]
};

/// `cft_double64` and `cft_string` of lsl_c.h.
const DOUBLE_FORMAT: c_int = 2;
const TEXT_FORMAT: c_int = 3;

/// Samples, or seconds of a regular stream, that an outlet keeps for a reader that is slow.
const OUTLET_KEPT_S: c_int = 360;

/// What the library hands out.
pub(super) type Pointer = *mut c_void;
// SAFETY: these are the functions of lsl_c.h; who calls one keeps what it asks of its pointers.
type CreateInfo =
    unsafe extern "C" fn(*const c_char, *const c_char, c_int, c_double, c_int, *const c_char) -> Pointer;
type GetDesc = unsafe extern "C" fn(Pointer) -> Pointer;
type AppendChild = unsafe extern "C" fn(Pointer, *const c_char) -> Pointer;
// SAFETY: as above.
type AppendValue = unsafe extern "C" fn(Pointer, *const c_char, *const c_char) -> Pointer;
type CreateOutlet = unsafe extern "C" fn(Pointer, c_int, c_int) -> Pointer;
pub(super) type Destroy = unsafe extern "C" fn(Pointer);
type PushNumbers = unsafe extern "C" fn(Pointer, *const c_double, c_double) -> c_int;
type PushTexts = unsafe extern "C" fn(Pointer, *const *const c_char, c_double) -> c_int;
type LocalClock = unsafe extern "C" fn() -> c_double;
type LibraryVersion = unsafe extern "C" fn() -> c_int;
// SAFETY: as above.
pub(super) type ResolveByPredicate =
    unsafe extern "C" fn(*mut Pointer, u32, *const c_char, i32, c_double) -> i32;
pub(super) type CreateInlet = unsafe extern "C" fn(Pointer, i32, i32, i32) -> Pointer;
pub(super) type GetFullInfo = unsafe extern "C" fn(Pointer, c_double, *mut i32) -> Pointer;
// SAFETY: as above.
pub(super) type GetXml = unsafe extern "C" fn(Pointer) -> *mut c_char;
pub(super) type DestroyText = unsafe extern "C" fn(*mut c_char);
pub(super) type OpenStream = unsafe extern "C" fn(Pointer, c_double, *mut i32);
// SAFETY: as above.
pub(super) type TimeCorrection =
    unsafe extern "C" fn(Pointer, *mut c_double, *mut c_double, c_double, *mut i32) -> c_double;
pub(super) type PullChunk = unsafe extern "C" fn(
    Pointer,
    *mut c_double,
    *mut c_double,
    c_ulong,
    c_ulong,
    c_double,
    *mut i32,
) -> c_ulong;

/// Why nothing can be published, or a stream cannot be recorded.
#[derive(Debug, thiserror::Error)]
pub enum LslError {
    /// The library is not there.
    #[error(
        "liblsl cannot be loaded ({reason}); --lsl and the streams of a rig file need it. Install it (https://github.com/sccn/liblsl), or \
         name its file with --lsl-library. The Python package pylsl brings one"
    )]
    NotFound {
        /// The operating system's reason.
        reason: String,
    },
    /// A library that is none of Lab Streaming Layer.
    #[error("--lsl-library {}: has no function {function}; expected liblsl 1.13 or later", path.display())]
    NoFunction {
        /// The library.
        path: PathBuf,
        /// What is missing.
        function: &'static str,
    },
    /// The library refuses a stream.
    #[error("--lsl: liblsl did not make the stream {stream:?}; is its network interface up?")]
    NoStream {
        /// Name of the stream.
        stream: String,
    },
    /// A stream of the rig file is not there, or is not as it must be.
    #[error("the rig file's stream {stream:?}: {found}; expected {expected}")]
    Stream {
        /// Name of the stream.
        stream: String,
        /// What was found.
        found: String,
        /// What was expected, and what to do.
        expected: String,
    },
}

/// The loaded library.
#[derive(Debug)]
pub struct LslLibrary {
    create_info: CreateInfo,
    get_desc: GetDesc,
    append_child: AppendChild,
    append_value: AppendValue,
    create_outlet: CreateOutlet,
    destroy_outlet: Destroy,
    destroy_info: Destroy,
    push_numbers: PushNumbers,
    push_texts: PushTexts,
    local_clock: LocalClock,
    pub(super) inlets: InletFunctions,
    version: c_int,
    /// Kept loaded for as long as its functions are.
    _library: Library,
}

/// The functions of the library that take a stream in.
#[derive(Debug)]
pub(super) struct InletFunctions {
    pub(super) resolve: ResolveByPredicate,
    pub(super) create: CreateInlet,
    pub(super) destroy: Destroy,
    pub(super) destroy_info: Destroy,
    pub(super) full_info: GetFullInfo,
    pub(super) xml: GetXml,
    pub(super) destroy_text: DestroyText,
    pub(super) open: OpenStream,
    pub(super) correction: TimeCorrection,
    pub(super) pull: PullChunk,
}

/// A stream to describe.
#[derive(Debug, Clone, Copy)]
pub struct StreamDescription<'a> {
    /// Its name.
    pub name: &'a str,
    /// What it is, such as `Markers`.
    pub kind: &'a str,
    /// Name and unit of each channel.
    pub channels: &'a [(&'a str, &'a str)],
    /// Samples a second; 0 for markers.
    pub rate_hz: f64,
    /// Whether it carries texts.
    pub is_text: bool,
    /// What tells it from that of another session.
    pub source: &'a str,
}

/// A stream that is published.
#[derive(Debug)]
pub struct Outlet<'a> {
    library: &'a LslLibrary,
    outlet: Pointer,
}

/// A text for C; one with a zero inside is cut there.
pub(super) fn text(text: &str) -> CString {
    CString::new(text.split('\0').next().unwrap_or_default()).unwrap_or_default()
}

impl LslLibrary {
    /// Loads the library from `file`, or from where the operating system finds it.
    ///
    /// # Errors
    /// If it is not there, or is another library.
    pub fn load(file: Option<&Path>) -> Result<Self, LslError> {
        let names: Vec<PathBuf> = match file {
            Some(file) => vec![file.to_owned()],
            None => NAMES.iter().map(PathBuf::from).collect(),
        };
        let mut reasons = Vec::new();
        for name in names {
            // SAFETY: the operator asked for this library; what it does when it is loaded is as trusted as the program itself.
            match unsafe { Library::new(&name) } {
                Ok(library) => return Self::of(library, &name),
                Err(error) => reasons.push(error.to_string()),
            }
        }
        Err(LslError::NotFound { reason: reasons.join("; ") })
    }

    fn of(library: Library, path: &Path) -> Result<Self, LslError> {
        macro_rules! function {
            ($kind:ty, $name:literal) => {{
                // SAFETY: the type is that of lsl_c.h, which has not changed since liblsl 1.13.
                let found: Result<Symbol<$kind>, _> = unsafe { library.get($name) };
                *found.map_err(|_| LslError::NoFunction { path: path.to_owned(), function: $name })?
            }};
        }
        let version = function!(LibraryVersion, "lsl_library_version");
        Ok(Self {
            create_info: function!(CreateInfo, "lsl_create_streaminfo"),
            get_desc: function!(GetDesc, "lsl_get_desc"),
            append_child: function!(AppendChild, "lsl_append_child"),
            append_value: function!(AppendValue, "lsl_append_child_value"),
            create_outlet: function!(CreateOutlet, "lsl_create_outlet"),
            destroy_outlet: function!(Destroy, "lsl_destroy_outlet"),
            destroy_info: function!(Destroy, "lsl_destroy_streaminfo"),
            push_numbers: function!(PushNumbers, "lsl_push_sample_dt"),
            push_texts: function!(PushTexts, "lsl_push_sample_strt"),
            local_clock: function!(LocalClock, "lsl_local_clock"),
            inlets: InletFunctions {
                resolve: function!(ResolveByPredicate, "lsl_resolve_bypred"),
                create: function!(CreateInlet, "lsl_create_inlet"),
                destroy: function!(Destroy, "lsl_destroy_inlet"),
                destroy_info: function!(Destroy, "lsl_destroy_streaminfo"),
                full_info: function!(GetFullInfo, "lsl_get_fullinfo"),
                xml: function!(GetXml, "lsl_get_xml"),
                destroy_text: function!(DestroyText, "lsl_destroy_string"),
                open: function!(OpenStream, "lsl_open_stream"),
                correction: function!(TimeCorrection, "lsl_time_correction_ex"),
                pull: function!(PullChunk, "lsl_pull_chunk_d"),
            },
            // SAFETY: takes nothing and gives a number.
            version: unsafe { version() },
            _library: library,
        })
    }

    /// Its version, as 118 for 1.18.
    pub fn version(&self) -> i32 {
        self.version
    }

    /// The time on its clock, s.
    pub fn now_s(&self) -> f64 {
        // SAFETY: takes nothing and gives a number.
        unsafe { (self.local_clock)() }
    }

    /// Publishes a stream.
    ///
    /// # Errors
    /// If the library refuses.
    pub fn outlet(&self, stream: &StreamDescription) -> Result<Outlet<'_>, LslError> {
        let refused = || LslError::NoStream { stream: stream.name.to_owned() };
        let format = if stream.is_text { TEXT_FORMAT } else { DOUBLE_FORMAT };
        let [name, kind, source] = [stream.name, stream.kind, stream.source].map(text);
        let count = stream.channels.len() as c_int;
        // SAFETY: the texts live during the call, which copies them.
        let info = unsafe {
            (self.create_info)(name.as_ptr(), kind.as_ptr(), count, stream.rate_hz, format, source.as_ptr())
        };
        if info.is_null() {
            return Err(refused());
        }
        // SAFETY: `info` is that of a stream that was just made; its description lives as long as it does.
        let channels = unsafe { (self.append_child)((self.get_desc)(info), text("channels").as_ptr()) };
        for (label, unit) in stream.channels {
            // SAFETY: as above; the texts live during the calls, which copy them.
            unsafe {
                let channel = (self.append_child)(channels, text("channel").as_ptr());
                (self.append_value)(channel, text("label").as_ptr(), text(label).as_ptr());
                (self.append_value)(channel, text("unit").as_ptr(), text(unit).as_ptr());
            }
        }
        // SAFETY: `info` is a stream's; the outlet has a copy of it, so that it can be destroyed, once.
        let outlet = unsafe {
            let outlet = (self.create_outlet)(info, 0, OUTLET_KEPT_S);
            (self.destroy_info)(info);
            outlet
        };
        if outlet.is_null() { Err(refused()) } else { Ok(Outlet { library: self, outlet }) }
    }
}

impl Outlet<'_> {
    /// Publishes a sample of numbers, one for each channel.
    pub fn push(&self, values: &[f64], time_s: f64) {
        // SAFETY: the outlet is alive, and there are as many values as it has channels, which the call copies. It cannot fail for
        // a stream of numbers; a return code would say that the stream is lost, and nobody is waiting for it here.
        let _ = unsafe { (self.library.push_numbers)(self.outlet, values.as_ptr(), time_s) };
    }

    /// Publishes a marker.
    pub fn push_text(&self, marker: &str, time_s: f64) {
        let marker = text(marker);
        let channels = [marker.as_ptr()];
        // SAFETY: the outlet is alive and has one channel of texts; the text lives during the call, which copies it.
        let _ = unsafe { (self.library.push_texts)(self.outlet, channels.as_ptr(), time_s) };
    }
}

impl Drop for Outlet<'_> {
    fn drop(&mut self) {
        // SAFETY: the outlet is alive and is not used after this.
        unsafe { (self.library.destroy_outlet)(self.outlet) };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_library_that_is_not_there_or_is_another_one_is_told() {
        let missing = LslLibrary::load(Some(Path::new("no-such-file.so"))).unwrap_err().to_string();
        assert!(
            missing.contains("liblsl cannot be loaded") && missing.contains("--lsl-library"),
            "{missing}"
        );
        #[cfg(target_os = "linux")]
        {
            let other = LslLibrary::load(Some(Path::new("libc.so.6"))).unwrap_err().to_string();
            assert!(other.contains("has no function lsl_library_version"), "{other}");
        }
    }
}
