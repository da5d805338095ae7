//! The generated pages of the book's reference are those that this code generates. `scripts/reference` writes them anew.

mod fields;
mod mechanisms;
mod messages;
