//! Chunks of XDF, the format of LabRecorder: "XDF Specification 1.0", the Swartz Center. A file is `XDF:` and chunks of a length, a tag and
//! content, so that a file that is cut off anywhere is whole up to its last chunk. The reader is in `import`. No crate writes this format.

/// What an XDF file begins with.
pub const XDF_MAGIC: &[u8] = b"XDF:";

/// What a chunk is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u16)]
pub enum XdfTag {
    /// XML about the file.
    FileHeader = 1,
    /// Number of a stream, and XML about it.
    StreamHeader = 2,
    /// Samples of a stream.
    Samples = 3,
    /// How far the clock of the recorder was ahead of that of a stream.
    ClockOffset = 4,
    /// Number of a stream, and XML about how it ended.
    StreamFooter = 6,
}

/// Adds a chunk to the bytes of a file.
pub fn xdf_chunk(bytes: &mut Vec<u8>, tag: XdfTag, content: &[u8]) {
    bytes.push(8);
    bytes.extend_from_slice(&(content.len() as u64 + 2).to_le_bytes());
    bytes.extend_from_slice(&(tag as u16).to_le_bytes());
    bytes.extend_from_slice(content);
}

/// Adds the header or the footer of a stream.
pub fn xdf_stream_chunk(bytes: &mut Vec<u8>, tag: XdfTag, stream: u32, xml: &str) {
    xdf_chunk(bytes, tag, &[&stream.to_le_bytes(), xml.as_bytes()].concat());
}

/// The header of a file, with further elements of its XML.
pub fn xdf_file_header(program: &str, elements: &str) -> Vec<u8> {
    let mut bytes = XDF_MAGIC.to_vec();
    let xml = format!(
        "<?xml version=\"1.0\"?><info><version>1.0</version><writer>{program}</writer>{elements}</info>"
    );
    xdf_chunk(&mut bytes, XdfTag::FileHeader, xml.as_bytes());
    bytes
}

/// The footer of a stream: its first and last time, and how many samples it has.
pub fn xdf_footer(bytes: &mut Vec<u8>, stream: u32, [first_s, last_s]: [f64; 2], samples: u64) {
    let xml = format!(
        "<?xml version=\"1.0\"?><info><first_timestamp>{first_s}</first_timestamp><last_timestamp>{last_s}</last_timestamp>\
         <sample_count>{samples}</sample_count><clock_offsets></clock_offsets></info>"
    );
    xdf_stream_chunk(bytes, XdfTag::StreamFooter, stream, &xml);
}

impl XdfTag {
    fn of(number: u16) -> Option<Self> {
        let all =
            [Self::FileHeader, Self::StreamHeader, Self::Samples, Self::ClockOffset, Self::StreamFooter];
        all.into_iter().find(|tag| *tag as u16 == number)
    }
}

/// The chunks of a file that this program wrote, up to the first that is cut off.
pub fn xdf_chunks(bytes: &[u8]) -> impl Iterator<Item = (XdfTag, &[u8])> {
    let mut rest = bytes.strip_prefix(XDF_MAGIC).unwrap_or(bytes);
    std::iter::from_fn(move || {
        let (head, behind) = rest.split_first_chunk::<9>()?;
        let length = u64::from_le_bytes(*head.last_chunk()?);
        let (chunk, behind) = behind.split_at_checked(usize::try_from(length).ok()?)?;
        rest = behind;
        let (tag, content) = chunk.split_first_chunk()?;
        Some((XdfTag::of(u16::from_le_bytes(*tag))?, content))
    })
}
