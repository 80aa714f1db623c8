//! Tables as columns of one type each, written batch after batch as CSV, JSON or Parquet.
//!
//! CSV has the texts of Python: `True`, `NaN`; a missing cell is empty. JSON is an array of objects in the order of the
//! columns; a missing cell, an infinity and NaN are `null`. Parquet has a row group per batch, compressed with zstd.

use std::io::{self, Write};
use std::sync::Arc;

use jiff::Timestamp;
use parquet::basic::{Compression, Encoding, LogicalType, Repetition, TimeUnit, Type as PhysicalType, ZstdLevel};
use parquet::data_type::{BoolType, ByteArray, ByteArrayType, DoubleType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::properties::{EnabledStatistics, WriterProperties};
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::{ColumnPath, Type};
use serde_json::Value;

/// Format of a written table; its name is the extension of its files.
#[derive(Debug, Clone, Copy, PartialEq, Eq, strum::IntoStaticStr, strum::EnumString, strum::VariantArray)]
#[strum(serialize_all = "lowercase")]
#[expect(missing_docs, reason = "the names say the rest")]
pub enum TableFormat {
    Csv,
    Json,
    Parquet,
}

/// Cells of a column that are not missing, row after row.
#[derive(Debug, Clone, PartialEq)]
pub enum Cells {
    /// Numbers.
    Number(Vec<f64>),
    /// Whole numbers.
    Whole(Vec<i64>),
    /// Truth values.
    Flag(Vec<bool>),
    /// Names of a fixed set.
    Name(Vec<&'static str>),
    /// Texts.
    Text(Vec<String>),
    /// Times, us since 1970, UTC.
    Time(Vec<i64>),
    /// Values of several types: a text as it is, everything else as JSON.
    Mixed(Vec<Value>),
}

/// A column of a batch.
#[derive(Debug, Clone, PartialEq)]
pub struct TypedColumn {
    /// Name, unique in its table.
    pub name: String,
    /// The cells that are not missing.
    pub cells: Cells,
    /// 1 for each row whose cell is there, 0 for a missing one; none for a column without missing cells.
    pub there: Option<Vec<i16>>,
}

impl TypedColumn {
    /// Makes a column without missing cells.
    pub fn new(name: impl Into<String>, cells: Cells) -> TypedColumn {
        TypedColumn { name: name.into(), cells, there: None }
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.there.as_ref().map_or_else(|| self.filled(), Vec::len)
    }

    /// Number of cells that are not missing.
    fn filled(&self) -> usize {
        match &self.cells {
            Cells::Number(cells) => cells.len(),
            Cells::Whole(cells) | Cells::Time(cells) => cells.len(),
            Cells::Flag(cells) => cells.len(),
            Cells::Name(cells) => cells.len(),
            Cells::Text(cells) => cells.len(),
            Cells::Mixed(cells) => cells.len(),
        }
    }

    /// Removes all rows and keeps their memory.
    pub fn clear(&mut self) {
        match &mut self.cells {
            Cells::Number(cells) => cells.clear(),
            Cells::Whole(cells) | Cells::Time(cells) => cells.clear(),
            Cells::Flag(cells) => cells.clear(),
            Cells::Name(cells) => cells.clear(),
            Cells::Text(cells) => cells.clear(),
            Cells::Mixed(cells) => cells.clear(),
        }
        if let Some(there) = &mut self.there {
            there.clear();
        }
    }

    /// Returns a cell as text and as JSON.
    fn cell(&self, index: usize) -> (String, String) {
        let quoted = |text: &str| Value::from(text).to_string();
        let same = |text: String| (text.clone(), text);
        match &self.cells {
            Cells::Number(cells) if cells[index].is_finite() => same(format!("{:?}", cells[index])),
            Cells::Number(cells) => (format!("{:?}", cells[index]), "null".to_owned()),
            Cells::Whole(cells) => same(cells[index].to_string()),
            Cells::Flag(cells) => ((if cells[index] { "True" } else { "False" }).to_owned(), cells[index].to_string()),
            Cells::Name(cells) => (cells[index].to_owned(), quoted(cells[index])),
            Cells::Text(cells) => (cells[index].clone(), quoted(&cells[index])),
            Cells::Time(cells) => (time(cells[index]), quoted(&time(cells[index]))),
            Cells::Mixed(cells) => (as_text(&cells[index]), cells[index].to_string()),
        }
    }
}

fn time(us: i64) -> String {
    let at = Timestamp::from_microsecond(us).unwrap_or_default();
    at.strftime("%Y-%m-%dT%H:%M:%S.%6fZ").to_string()
}

fn as_text(value: &Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}

/// Destination of a table. Not a type parameter: the encoders are large, and would be compiled for each type.
type Destination<'a> = &'a mut (dyn Write + Send);

/// Writer of a table.
pub struct TableWriter<'a> {
    form: Form<'a>,
}

enum Form<'a> {
    Csv(Box<csv::Writer<Destination<'a>>>),
    Json { out: Destination<'a>, rows: usize },
    Parquet(Box<SerializedFileWriter<Destination<'a>>>),
}

impl<'a> TableWriter<'a> {
    /// Begins a table with the names and types of these columns.
    ///
    /// # Errors
    /// When `out` cannot be written, or two columns have one name.
    pub fn new(
        format: TableFormat,
        out: &'a mut (dyn Write + Send),
        columns: &[TypedColumn],
    ) -> io::Result<TableWriter<'a>> {
        let form = match format {
            TableFormat::Csv => {
                let mut writer = csv::Writer::from_writer(out);
                writer.write_record(columns.iter().map(|column| &column.name)).map_err(csv_error)?;
                Form::Csv(Box::new(writer))
            }
            TableFormat::Json => Form::Json { out, rows: 0 },
            TableFormat::Parquet => Form::Parquet(Box::new(begin_parquet(out, columns).map_err(io_error)?)),
        };
        Ok(TableWriter { form })
    }

    /// Writes a batch: the columns of [`new`](TableWriter::new) with further rows, equally many in each.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn write(&mut self, columns: &[TypedColumn]) -> io::Result<()> {
        let rows = columns.first().map_or(0, TypedColumn::rows);
        debug_assert!(columns.iter().all(|column| column.rows() == rows));
        match &mut self.form {
            Form::Parquet(writer) => write_row_group(writer, columns).map_err(io_error),
            Form::Csv(writer) => {
                let mut next = vec![0; columns.len()];
                for row in 0..rows {
                    let cells = cells(columns, row, &mut next).map(|cell| cell.map_or_else(String::new, |cell| cell.0));
                    writer.write_record(cells).map_err(csv_error)?;
                }
                Ok(())
            }
            Form::Json { out, rows: before } => {
                let mut next = vec![0; columns.len()];
                for row in 0..rows {
                    let separator = if *before + row == 0 { "[\n" } else { ",\n" };
                    let members = columns.iter().zip(cells(columns, row, &mut next)).map(|(column, cell)| {
                        format!(
                            "{}:{}",
                            Value::from(column.name.as_str()),
                            cell.map_or("null".to_owned(), |cell| cell.1)
                        )
                    });
                    write!(out, "{separator}{{{}}}", members.collect::<Vec<_>>().join(","))?;
                }
                *before += rows;
                Ok(())
            }
        }
    }

    /// Completes the table.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn finish(self) -> io::Result<()> {
        match self.form {
            Form::Csv(writer) => writer.into_inner().map(drop).map_err(csv::IntoInnerError::into_error),
            Form::Json { out, rows } => out.write_all(if rows == 0 { b"[\n]\n" } else { b"\n]\n" }),
            Form::Parquet(writer) => writer.into_inner().map(drop).map_err(io_error),
        }
    }
}

/// Returns the cells of a row; `next` has the index of the next cell of each column.
fn cells(columns: &[TypedColumn], row: usize, next: &mut [usize]) -> impl Iterator<Item = Option<(String, String)>> {
    columns.iter().zip(next).map(move |(column, next)| {
        let there = column.there.as_ref().is_none_or(|there| there[row] == 1);
        there.then(|| {
            *next += 1;
            column.cell(*next - 1)
        })
    })
}

/// Returns the error of the file behind an error of the CSV writer, so that its kind is kept.
fn csv_error(error: csv::Error) -> io::Error {
    match error.into_kind() {
        csv::ErrorKind::Io(source) => source,
        other => io::Error::other(format!("{other:?}")),
    }
}

/// Returns the error of the file behind an error of the encoder, so that its cause, for example a full disk, is named.
fn io_error(error: ParquetError) -> io::Error {
    match error {
        ParquetError::External(source) => match source.downcast::<io::Error>() {
            Ok(source) => *source,
            Err(source) => io::Error::other(source),
        },
        other => io::Error::other(other),
    }
}

fn begin_parquet<'a>(
    out: Destination<'a>,
    columns: &[TypedColumn],
) -> Result<SerializedFileWriter<Destination<'a>>, ParquetError> {
    let mut properties = WriterProperties::builder()
        .set_created_by(concat!("quadfrog ", env!("CARGO_PKG_VERSION")).to_owned())
        .set_compression(Compression::ZSTD(ZstdLevel::try_new(1)?))
        .set_statistics_enabled(EnabledStatistics::None);
    let mut fields = Vec::with_capacity(columns.len());
    for column in columns {
        let (physical, logical) = match &column.cells {
            Cells::Number(_) => (PhysicalType::DOUBLE, None),
            Cells::Whole(_) => (PhysicalType::INT64, None),
            Cells::Flag(_) => (PhysicalType::BOOLEAN, None),
            Cells::Time(_) => (PhysicalType::INT64, Some(LogicalType::timestamp(true, TimeUnit::MICROS))),
            Cells::Name(_) | Cells::Text(_) | Cells::Mixed(_) => (PhysicalType::BYTE_ARRAY, Some(LogicalType::String)),
        };
        let repetition = if column.there.is_some() { Repetition::OPTIONAL } else { Repetition::REQUIRED };
        let field = Type::primitive_type_builder(&column.name, physical)
            .with_logical_type(logical)
            .with_repetition(repetition)
            .build()?;
        fields.push(Arc::new(field));
        if matches!(column.cells, Cells::Number(_)) {
            // Measured values rarely repeat: without a dictionary; grouped by the bytes' significance they compress better.
            let path = ColumnPath::new(vec![column.name.clone()]);
            properties = properties
                .set_column_dictionary_enabled(path.clone(), false)
                .set_column_encoding(path, Encoding::BYTE_STREAM_SPLIT);
        }
    }
    let schema = Type::group_type_builder("table").with_fields(fields).build()?;
    SerializedFileWriter::new(out, Arc::new(schema), Arc::new(properties.build()))
}

fn write_row_group(
    writer: &mut SerializedFileWriter<Destination>,
    columns: &[TypedColumn],
) -> Result<(), ParquetError> {
    if columns.first().is_none_or(|column| column.rows() == 0) {
        return Ok(());
    }
    let mut group = writer.next_row_group()?;
    for TypedColumn { cells, there, .. } in columns {
        let Some(mut column) = group.next_column()? else { break };
        let there = there.as_deref();
        match cells {
            Cells::Number(cells) => column.typed::<DoubleType>().write_batch(cells, there, None)?,
            Cells::Whole(cells) | Cells::Time(cells) => column.typed::<Int64Type>().write_batch(cells, there, None)?,
            Cells::Flag(cells) => column.typed::<BoolType>().write_batch(cells, there, None)?,
            Cells::Name(cells) => column.typed::<ByteArrayType>().write_batch(&shared(cells), there, None)?,
            Cells::Text(cells) => {
                let cells: Vec<ByteArray> = cells.iter().map(|cell| cell.as_str().into()).collect();
                column.typed::<ByteArrayType>().write_batch(&cells, there, None)?
            }
            Cells::Mixed(cells) => {
                let cells: Vec<ByteArray> = cells.iter().map(|cell| as_text(cell).as_str().into()).collect();
                column.typed::<ByteArrayType>().write_batch(&cells, there, None)?
            }
        };
        column.close()?;
    }
    group.close().map(drop)
}

/// Returns the names as values of the encoder, of which equal ones share their memory.
fn shared(names: &[&'static str]) -> Vec<ByteArray> {
    let mut known: Vec<(&str, ByteArray)> = Vec::new();
    names
        .iter()
        .map(|name| match known.iter().find(|(of, _)| of == name) {
            Some((_, bytes)) => bytes.clone(),
            None => {
                known.push((name, (*name).into()));
                (*name).into()
            }
        })
        .collect()
}
