//! Writers: SynTable, PNG, NumPy, JSON lines, Tera templates, contact sheets.
