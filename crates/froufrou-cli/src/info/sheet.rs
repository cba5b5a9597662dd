//! Text for people: facts with their labels, and tables, in aligned columns.

use std::fmt;

/// Lines of aligned text.
#[derive(Debug, Default)]
pub struct Sheet {
    facts: Vec<(&'static str, String)>,
    tables: Vec<Table>,
}

#[derive(Debug)]
struct Table {
    heads: Vec<String>,
    rows: Vec<Vec<String>>,
    left_out: usize,
}

/// The longest table that is shown whole.
const MOST_ROWS: usize = 200;

impl Sheet {
    /// Adds a fact.
    pub fn fact(&mut self, label: &'static str, value: impl fmt::Display) -> &mut Self {
        self.facts.push((label, value.to_string()));
        self
    }

    /// Adds a fact where there is one.
    pub fn fact_if(&mut self, label: &'static str, value: Option<impl fmt::Display>) -> &mut Self {
        match value {
            Some(value) => self.fact(label, value),
            None => self,
        }
    }

    /// Adds a table, unless it is empty. Very long ones are cut off with a word about it; the JSON
    /// has them whole.
    pub fn table(
        &mut self,
        heads: &[impl AsRef<str>],
        rows: impl IntoIterator<Item = Vec<String>>,
    ) -> &mut Self {
        let mut rows = rows.into_iter();
        let shown: Vec<Vec<String>> = rows.by_ref().take(MOST_ROWS).collect();
        if !shown.is_empty() {
            self.tables.push(Table {
                heads: heads.iter().map(|head| head.as_ref().to_owned()).collect(),
                rows: shown,
                left_out: rows.count(),
            });
        }
        self
    }
}

/// A text without what would break its line.
fn in_line(text: &str) -> String {
    text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect()
}

impl fmt::Display for Sheet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let width = self.facts.iter().map(|(label, _)| label.chars().count()).max().unwrap_or(0);
        for (label, value) in &self.facts {
            writeln!(f, "{label:width$}  {}", in_line(value))?;
        }
        for Table { heads, rows, left_out } in &self.tables {
            writeln!(f)?;
            let length = |cell: &str| cell.chars().count();
            let widths: Vec<usize> = (0..heads.len())
                .map(|column| {
                    let cells = rows.iter().filter_map(|row| row.get(column)).map(|cell| length(cell));
                    cells.fold(length(&heads[column]), usize::max)
                })
                .collect();
            for row in std::iter::once(heads).chain(rows) {
                let mut line = String::new();
                for (cell, width) in row.iter().zip(&widths) {
                    line.push_str(&format!("{:width$}  ", in_line(cell)));
                }
                writeln!(f, "{}", line.trim_end())?;
            }
            if *left_out > 0 {
                writeln!(f, "… and {left_out} more; --json has them all")?;
            }
        }
        Ok(())
    }
}

/// A number for people: four significant digits, whole numbers whole.
pub fn number(value: f64) -> String {
    if value == value.trunc() && value.abs() < 1e9 {
        return format!("{value}");
    }
    if value.abs() >= 1e9 || (value != 0.0 && value.abs() < 1e-4) {
        return format!("{value:.3e}");
    }
    let digits = (3.0 - value.abs().log10().floor()).clamp(0.0, 8.0) as usize;
    let text = format!("{value:.digits$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

/// A position in metres.
pub fn position(position_m: [f64; 3]) -> String {
    position_m.map(number).join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_aligned() {
        let mut sheet = Sheet::default();
        sheet.fact("rate", "48 kHz").fact("channels", 2).fact_if("none", None::<u8>);
        let row = |name: &str, n: u8| vec![name.to_owned(), n.to_string()];
        sheet.table(&["name", "n"], [row("é", 1), row("a\nlong one", 22)]).table(&["empty"], []);
        let expected = "rate      48 kHz\nchannels  2\n\nname        n\né           1\na long one  22\n";
        assert_eq!(sheet.to_string(), expected);
    }

    #[test]
    fn long_tables_say_what_they_leave_out() {
        let mut sheet = Sheet::default();
        sheet.table(&["n"], (0..MOST_ROWS + 7).map(|n| vec![n.to_string()]));
        assert!(sheet.to_string().ends_with("\n199\n… and 7 more; --json has them all\n"));
    }

    #[test]
    fn numbers_have_four_digits() {
        let told = [0.0, 1.0, 48_000.0, 1.0 / 3.0, 123.456, 0.012_345_6, 1.2e-7, -2.5, 12_345.67].map(number);
        assert_eq!(told, ["0", "1", "48000", "0.3333", "123.5", "0.01235", "1.200e-7", "-2.5", "12346"]);
    }
}
