//! The parameter section of a C3D file: groups of named values.

use super::processor::Processor;
use crate::import::byte_cursor::Cursor;

/// Types of values.
const TEXT: i8 = -1;
const BYTE: i8 = 1;
const INTEGER: i8 = 2;
const FLOAT: i8 = 4;

/// Bytes before the first group: two that are not used, the number of blocks, the processor.
const SECTION_HEADER: usize = 4;

/// The most that programs add to the name of a parameter with more than 255 values: `LABELS2` to `LABELS257` for as many channels as
/// can be counted.
const MOST_CONTINUATIONS: usize = 257;

/// The most groups and parameters that are read.
const MOST_ENTRIES: usize = 10_000;

/// The parameters of a file.
#[derive(Debug)]
pub struct Parameters<'a> {
    processor: Processor,
    /// Names of groups with their numbers. A name may come twice.
    groups: Vec<(String, i8)>,
    parameters: Vec<Parameter<'a>>,
}

#[derive(Debug)]
struct Parameter<'a> {
    group: i8,
    name: String,
    kind: i8,
    dimensions: &'a [u8],
    data: &'a [u8],
}

impl<'a> Parameters<'a> {
    /// Reads the number format, which the header has too, from the begin of a section.
    pub fn read_processor(section: &[u8]) -> Result<Processor, String> {
        let number = section.get(3).ok_or("a parameter section that is cut off")?;
        Processor::numbered(*number).ok_or_else(|| {
            format!("a parameter section of processor {number}, where 84, 85 and 86 are known")
        })
    }

    /// Reads a section in the number format that [`Self::read_processor`] gives; the error says what is wrong with it.
    pub fn read(section: &'a [u8], processor: Processor) -> Result<Self, String> {
        let mut own = Self { processor, groups: Vec::new(), parameters: Vec::new() };
        let mut at = SECTION_HEADER;
        while let Some(next) = own.read_entry(section, at)? {
            // The distance to the next entry is counted from behind its begin, so that this goes on.
            at = next;
            if own.groups.len() + own.parameters.len() > MOST_ENTRIES {
                return Err(format!("more than {MOST_ENTRIES} parameters"));
            }
        }
        Ok(own)
    }

    /// Reads a group or a parameter, and gives the place of the next.
    fn read_entry(&mut self, section: &'a [u8], at: usize) -> Result<Option<usize>, String> {
        let cut_off = || format!("a parameter section that is cut off or damaged at its byte {at}");
        let mut cursor = Cursor(section.get(at..).ok_or_else(cut_off)?);
        let [length, group] = cursor.number::<2>().ok_or_else(cut_off)?.map(|byte| byte as i8);
        // A locked entry has a negative length.
        let length = usize::from(length.unsigned_abs());
        if length == 0 {
            return Ok(None);
        }
        let name = cursor.take(length).ok_or_else(cut_off)?;
        let name = String::from_utf8_lossy(name).trim().to_uppercase();
        let distance_at = at + 2 + length;
        let distance = self.processor.word(cursor.number().ok_or_else(cut_off)?);
        if group < 0 {
            self.groups.push((name, group.saturating_neg()));
        } else {
            let [kind, dimensions] = cursor.number::<2>().ok_or_else(cut_off)?;
            let (kind, dimensions) = (kind as i8, cursor.take(usize::from(dimensions)).ok_or_else(cut_off)?);
            let width = match kind {
                TEXT | BYTE => 1,
                INTEGER => 2,
                FLOAT => 4,
                _ => return Err(format!("parameter {name} with values of type {kind}")),
            };
            let size =
                dimensions.iter().try_fold(width, |size: usize, own| size.checked_mul(usize::from(*own)));
            let data = size.and_then(|size| cursor.take(size)).ok_or_else(cut_off)?;
            self.parameters.push(Parameter { group, name, kind, dimensions, data });
        }
        Ok((distance != 0).then_some(distance_at + usize::from(distance)))
    }

    /// The number format of the file.
    pub fn processor(&self) -> Processor {
        self.processor
    }

    fn find(&self, group: &str, name: &str) -> Option<&Parameter<'a>> {
        let is_in_group = |own: &&Parameter| {
            own.name == name && self.groups.iter().any(|(name, number)| name == group && *number == own.group)
        };
        self.parameters.iter().find(is_in_group)
    }

    /// The values of a parameter and of its continuations (`SCALE`, `SCALE2` and so on); `None` if it is not there or a text.
    pub fn numbers(&self, group: &str, name: &str, are_integers_signed: bool) -> Option<Vec<f64>> {
        let first = self.find(group, name)?.numbers(self.processor, are_integers_signed)?;
        let others = self.continuations(group, name);
        let others = others.filter_map(|own| own.numbers(self.processor, are_integers_signed));
        Some(first.into_iter().chain(others.flatten()).collect())
    }

    /// The first value of a parameter that counts, whose integers have no sign.
    pub fn count(&self, group: &str, name: &str) -> Option<f64> {
        self.numbers(group, name, false)?.first().copied()
    }

    /// The texts of a parameter and of its continuations, without the spaces that fill them.
    pub fn texts(&self, group: &str, name: &str) -> Vec<String> {
        let first = self.find(group, name).into_iter();
        first.chain(self.continuations(group, name)).flat_map(Parameter::texts).collect()
    }

    fn continuations(&self, group: &str, name: &str) -> impl Iterator<Item = &Parameter<'a>> {
        (2..=MOST_CONTINUATIONS).map_while(move |number| self.find(group, &format!("{name}{number}")))
    }
}

impl Parameter<'_> {
    fn numbers(&self, processor: Processor, are_integers_signed: bool) -> Option<Vec<f64>> {
        let integer = |bytes: &[u8; 2]| match processor.word(*bytes) {
            word if are_integers_signed => f64::from(word as i16),
            word => f64::from(word),
        };
        match self.kind {
            BYTE => Some(self.data.iter().map(|byte| f64::from(*byte)).collect()),
            INTEGER => Some(self.data.as_chunks().0.iter().map(integer).collect()),
            FLOAT => Some(self.data.as_chunks().0.iter().map(|bytes| processor.float(*bytes)).collect()),
            _ => None,
        }
    }

    fn texts(&self) -> Vec<String> {
        if self.kind != TEXT {
            return Vec::new();
        }
        // The first dimension is the length of a text; a single one need not have a second.
        let length = self.dimensions.first().map_or(1, |length| usize::from(*length));
        if length == 0 {
            return Vec::new();
        }
        let count = self.dimensions.iter().skip(1).map(|own| usize::from(*own)).product();
        let text = |number: usize| {
            let text = &self.data[number * length..][..length];
            String::from_utf8_lossy(text)
                .trim_matches(|own: char| own == '\0' || own.is_whitespace())
                .to_owned()
        };
        (0..count).map(text).collect()
    }
}
