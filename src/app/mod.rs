//! What the verbs of the command line share. A verb imports from here and from the modules above, never from another verb.
//!
//! This is the part of the program below the command line: it prints messages, asks the operator and chooses exit codes.

mod analysis;
mod background_messages;
mod calibration;
mod checked_session;
mod command_line_operator;
mod console;
mod console_options;
mod day_check;
mod diagnosis_file;
mod failure;
mod fit_table;
mod import_questions;
mod laboratory;
mod laboratory_checks;
mod laboratory_console;
mod laboratory_lists;
mod laboratory_sessions;
mod model_file;
mod motor_operator;
mod named_results;
mod new_session;
mod pace;
mod protocol_text;
mod question;
mod requested_rig;
mod results_folder;
mod resume_request;
mod rig_calibration;
mod safe_output;
mod seed;
mod session_report;
mod session_request;
mod session_results;
mod session_rig;
mod session_runner;
mod session_state;
mod session_streams;
mod signals;
mod wall_clock;

pub use analysis::{
    AnalysedSession, AnalysisRequest, DiagnosedSession, FittedSession, check_none_left_out, with_window,
};
pub use calibration::{UsedCalibration, warn_of_calibration};
pub use checked_session::{CheckedSession, load_checked};
pub use console::Console;
pub use console_options::{ConsoleOptions, PageOptions, SessionDescription};
pub use diagnosis_file::{named_causes, read_diagnosis, read_stored_fit};
pub use failure::Failure;
pub use fit_table::fit_table;
pub use import_questions::ask_for_mapping;
pub use laboratory::Laboratory;
pub use laboratory_console::LaboratoryConsole;
pub use model_file::{add_mechanisms_of_model, read_model};
pub use named_results::{folder_of_diagnosis, folder_of_fit};
pub use new_session::{draw_seed, new_folder, subject_number};
pub use pace::Pace;
pub use protocol_text::{duration_text, rig_trials_text, trials_text};
pub use question::ask;
pub use requested_rig::RequestedRig;
pub use results_folder::{ResultsFolder, check_has_none, check_out, folders_in, lock_results};
pub use resume_request::ResumeRequest;
pub use rig_calibration::{calibrate_given_rig, calibrate_rig, compare_given_rig, compare_rig};
pub use seed::parse_seed;
pub use session_report::{tell_foreign_results, write_report, write_report_to, write_study_report};
pub use session_request::{NewSessionFolder, RequestedSubject, SessionRequest};
pub use session_results::finish_session;
pub use session_rig::{
    SessionRig, StoredVirtualRig, is_can_rig_file, open_seal, ran_on_can_motor, read_stored_virtual_rig,
    stored_streams, with_hidden_effect,
};
pub use session_runner::SessionRun;
pub use session_state::{SessionState, SessionSummary, announce_unfinished};
pub use session_streams::{RecordedStreams, SessionStreams, attach_streams};
pub use signals::stop_on_signals;
pub use wall_clock::{now_utc, operator_name, utc_offset_s};
