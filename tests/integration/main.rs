//! The program and the library from outside, in one test binary: it is linked once, and tests that wait run side by side.

mod architecture;
mod cohort;
mod command_line;
mod console;
mod crash_recovery;
mod diagnosis;
mod disk_faults;
mod documentation;
mod fit_input;
mod input_checks;
mod motor_cycle_memory;
mod optional_parts;
mod protocol_check;
mod protocol_fields;
mod protocol_kinds;
mod provenance;
mod reference;
mod report;
mod resume;
mod run;
mod schedule;
mod session_fit;
mod source_rules;
mod supply_chain;
mod workspace;
