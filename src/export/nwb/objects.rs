//! The attributes by which readers of NWB know the groups and datasets of an HDF5 file.

use hdf5_pure::{AttrValue, DatasetBuilder, GroupBuilder};

use crate::dataset::sha256;

/// A type of NWB.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NwbType {
    /// The file itself.
    File,
    /// The subject.
    Subject,
    /// Samples of a channel with their times.
    TimeSeries,
    /// A table of stretches of time.
    TimeIntervals,
    /// The numbers of a table's rows.
    ElementIdentifiers,
    /// A column of a table.
    VectorData,
}

impl NwbType {
    /// Its name, and that of the namespace which defines it.
    fn names(self) -> (&'static str, &'static str) {
        match self {
            Self::File => ("NWBFile", "core"),
            Self::Subject => ("Subject", "core"),
            Self::TimeSeries => ("TimeSeries", "core"),
            Self::TimeIntervals => ("TimeIntervals", "core"),
            Self::ElementIdentifiers => ("ElementIdentifiers", "hdmf-common"),
            Self::VectorData => ("VectorData", "hdmf-common"),
        }
    }
}

/// Gives the objects of a file identifiers that follow from the session: a session always makes the same file.
#[derive(Debug)]
pub struct ObjectIds {
    digest: String,
}

impl ObjectIds {
    /// Those of the file of the session with this digest.
    pub fn new(digest: &str) -> Self {
        Self { digest: digest.to_owned() }
    }

    /// Identifier of the object at `path`: a UUID of version 8 (RFC 9562) from the SHA-256 of digest and path.
    pub fn of(&self, path: &str) -> String {
        let sum = sha256(format!("{} {path}", self.digest).as_bytes());
        format!("{}-{}-8{}-8{}-{}", &sum[..8], &sum[8..12], &sum[13..16], &sum[17..20], &sum[20..32])
    }

    /// The attributes that every object of a type has.
    pub fn attributes(&self, kind: NwbType, path: &str) -> [(&'static str, AttrValue); 3] {
        let (name, namespace) = kind.names();
        [("namespace", text(namespace)), ("neurodata_type", text(name)), ("object_id", text(self.of(path)))]
    }

    /// Makes the group at `path`, an object of a type, as one of `parent`, which adds it once it is filled.
    pub fn group(&self, parent: &mut GroupBuilder, kind: NwbType, path: &str) -> GroupBuilder {
        let mut group = parent.create_group(path.rsplit('/').next().unwrap_or(path));
        for (name, value) in self.attributes(kind, path) {
            group.set_attr(name, value);
        }
        group
    }

    /// Makes the dataset at `path` an object of a type.
    pub fn identify(&self, dataset: &mut DatasetBuilder, kind: NwbType, path: &str) {
        for (name, value) in self.attributes(kind, path) {
            dataset.set_attr(name, value);
        }
    }
}

/// An attribute of text.
pub fn text(value: impl Into<String>) -> AttrValue {
    AttrValue::VarLenString(value.into())
}

/// Fills a dataset with one text.
pub fn fill_text<'a>(dataset: &'a mut DatasetBuilder, value: &str) -> &'a mut DatasetBuilder {
    dataset.with_vlen_strings(&[value]).with_shape(&[])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_identifier_is_a_uuid_of_session_and_path() {
        let ids = ObjectIds::new("ab");
        let own = ids.of("/acquisition/theta_m_rad");
        assert_eq!(own, ObjectIds::new("ab").of("/acquisition/theta_m_rad"));
        assert_ne!(own, ids.of("/acquisition/torque_l_nm"));
        assert_ne!(own, ObjectIds::new("ac").of("/acquisition/theta_m_rad"));
        let parts: Vec<usize> = own.split('-').map(str::len).collect();
        assert_eq!(parts, [8, 4, 4, 4, 12]);
        // Version and variant.
        assert_eq!((&own[14..15], &own[19..20]), ("8", "8"));
        assert!(own.chars().all(|c| c == '-' || c.is_ascii_hexdigit()));
    }
}
