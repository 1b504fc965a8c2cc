#pragma once

#include <string>
#include <vector>

#include <nlohmann/json.hpp>

namespace dynamic_slam {

// Cells as they are read, for the terminal, CSV, and the page.
struct Table {
  struct Column {
    std::string name;
    std::string group = "";   // neighbours with the same group have a common heading
    bool is_text = false;     // to the left
    bool on_terminal = true;  // too wide a table is of no use there
  };

  std::string title, note;
  std::vector<Column> columns;
  std::vector<std::vector<std::string>> rows;  // a cell for each column
};

// In columns, with title and note.
std::string TerminalText(const Table& table);

// All columns; a heading is "group: name".
std::string CsvText(const Table& table);

// {"title", "note", "rows": [{"group: name": "cell", ...}, ...]}.
nlohmann::ordered_json TableJson(const Table& table);

// For ReportPage.
nlohmann::ordered_json TableSection(const Table& table);

// Of flat objects with the same keys; numbers are cut to so many significant digits.
Table TableOfRows(const std::string& title, const nlohmann::ordered_json& rows, int digits = 5);

}  // namespace dynamic_slam
