//! The format of tables that commands write, by `--format` or the name of the file.

use std::path::Path;

use clap::builder::TypedValueParser;
use quadfrog::report::columns::TableFormat;

use super::arguments::one_of;
use super::failure::Failure;

const CSV: (TableFormat, &str, &str) = (TableFormat::Csv, "csv", "Comma-separated values");
const JSON: (TableFormat, &str, &str) = (TableFormat::Json, "json", "An array of objects");

/// Value of an argument that selects the format of a written table.
pub fn table_format() -> impl TypedValueParser<Value = TableFormat> {
    one_of([CSV, JSON, (TableFormat::Parquet, "parquet", "Apache Parquet, for pandas and polars")])
}

/// Value of an argument that names the format of a table to be read.
pub fn read_table_format() -> impl TypedValueParser<Value = TableFormat> {
    one_of([CSV, JSON])
}

/// Returns the format that the extension of a name says.
pub fn format_of_name(file: &Path) -> Option<TableFormat> {
    file.extension()?.to_str()?.to_ascii_lowercase().parse().ok()
}

/// Returns the format of a table that is written to `file`, or to standard output: the given one, else that of the name. CSV
/// where neither is given.
///
/// # Errors
/// When name and given format differ, when the name says no format and none is given, or Parquet for standard output.
pub fn written_format(given: Option<TableFormat>, file: Option<&Path>) -> Result<TableFormat, Failure> {
    let Some(file) = file else {
        return match given {
            Some(TableFormat::Parquet) => Err(Failure::input("--format parquet: give a file, --output FILE.parquet")),
            given => Ok(given.unwrap_or(TableFormat::Csv)),
        };
    };
    match (given, format_of_name(file)) {
        (Some(given), Some(named)) if given != named => Err(Failure::input(format!(
            "--format {}: the name {} says {}; give another name or another format",
            <&str>::from(given),
            file.display(),
            <&str>::from(named)
        ))),
        (Some(format), _) | (None, Some(format)) => Ok(format),
        (None, None) => Err(Failure::input(format!(
            "{}: the name says no format; end it in .csv, .json or .parquet, or give --format",
            file.display()
        ))),
    }
}
