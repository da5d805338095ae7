//! The files of `protocols/`, for programs that are not started in the repository.

/// Name and text of each file; the study names protocol, person and rig by these names.
pub const EXAMPLES: [(&str, &str); 6] = [
    ("quick.json", include_str!("../../protocols/quick.json")),
    ("de-vlugt-2011.json", include_str!("../../protocols/de-vlugt-2011.json")),
    ("de-vlugt-2011-rig-trials.json", include_str!("../../protocols/de-vlugt-2011-rig-trials.json")),
    ("de-vlugt-2011-person.json", include_str!("../../protocols/de-vlugt-2011-person.json")),
    ("de-vlugt-2011-rig.json", include_str!("../../protocols/de-vlugt-2011-rig.json")),
    ("de-vlugt-2011-study.json", include_str!("../../protocols/de-vlugt-2011-study.json")),
];
