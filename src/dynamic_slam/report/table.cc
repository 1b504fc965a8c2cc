#include "dynamic_slam/report/table.h"

#include <algorithm>

#include <fmt/format.h>

namespace dynamic_slam {
namespace {

std::string Heading(const Table::Column& column) {
  return column.group.empty() ? column.name : fmt::format("{}: {}", column.group, column.name);
}

// Of UTF-8, as far as every character is one column wide.
size_t Width(const std::string& text) {
  return static_cast<size_t>(
      std::count_if(text.begin(), text.end(), [](char c) { return (c & 0xC0) != 0x80; }));
}

std::string Padded(const std::string& text, size_t width, bool to_the_left) {
  const std::string space(width - std::min(width, Width(text)), ' ');
  return to_the_left ? text + space : space + text;
}

std::string CsvCell(const std::string& text) {
  if (text.find_first_of(",\"\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + "\"";
}

std::string WithoutSpaceAtEnds(const std::string& text) {
  std::string result;
  for (const char c : text) {
    if (c == '\n') result.erase(result.find_last_not_of(' ') + 1);
    result += c;
  }
  return result;
}

}  // namespace

std::string TerminalText(const Table& table) {
  std::vector<size_t> shown, widths;
  for (size_t i = 0; i < table.columns.size(); ++i) {
    if (!table.columns[i].on_terminal) continue;
    size_t width = Width(table.columns[i].name);
    for (const auto& row : table.rows) width = std::max(width, Width(row[i]));
    shown.push_back(i);
    widths.push_back(width);
  }
  // A group's heading needs room over its columns.
  std::string groups, names;
  for (size_t k = 0; k < shown.size();) {
    const std::string& group = table.columns[shown[k]].group;
    size_t end = k + 1, room = widths[k];
    while (end < shown.size() && !group.empty() && table.columns[shown[end]].group == group) {
      room += 2 + widths[end++];
    }
    if (Width(group) > room) {
      widths[end - 1] += Width(group) - room;
      room = Width(group);
    }
    groups += Padded(group, room, true) + "  ";
    k = end;
  }
  const auto line = [&](const auto& cell) {
    std::string text;
    for (size_t k = 0; k < shown.size(); ++k) {
      text += Padded(cell(shown[k]), widths[k], table.columns[shown[k]].is_text) + "  ";
    }
    return text + "\n";
  };
  std::string text = table.title + "\n";
  if (groups.find_first_not_of(' ') != std::string::npos) text += groups + "\n";
  text += line([&](size_t i) { return table.columns[i].name; });
  for (const auto& row : table.rows) {
    text += line([&](size_t i) { return row[i]; });
  }
  if (!table.note.empty()) text += table.note + "\n";
  return WithoutSpaceAtEnds(text);
}

std::string CsvText(const Table& table) {
  std::vector<std::string> headings;
  for (const Table::Column& column : table.columns) headings.push_back(CsvCell(Heading(column)));
  std::string text = fmt::format("{}\n", fmt::join(headings, ","));
  for (const auto& row : table.rows) {
    std::vector<std::string> cells;
    for (const std::string& cell : row) cells.push_back(CsvCell(cell));
    text += fmt::format("{}\n", fmt::join(cells, ","));
  }
  return text;
}

nlohmann::ordered_json TableJson(const Table& table) {
  nlohmann::ordered_json rows = nlohmann::ordered_json::array();
  for (const auto& cells : table.rows) {
    nlohmann::ordered_json row;
    for (size_t i = 0; i < cells.size(); ++i) row[Heading(table.columns[i])] = cells[i];
    rows.push_back(std::move(row));
  }
  return {{"title", table.title}, {"note", table.note}, {"rows", std::move(rows)}};
}

nlohmann::ordered_json TableSection(const Table& table) {
  nlohmann::ordered_json columns = nlohmann::ordered_json::array();
  for (const Table::Column& column : table.columns) {
    columns.push_back({{"name", column.name}, {"group", column.group}, {"text", column.is_text}});
  }
  return {{"type", "table"},
          {"title", table.title},
          {"short", table.title.substr(0, table.title.find(':'))},
          {"note", table.note},
          {"columns", std::move(columns)},
          {"rows", table.rows}};
}

Table TableOfRows(const std::string& title, const nlohmann::ordered_json& rows, int digits) {
  Table table{.title = title, .note = "", .columns = {}, .rows = {}};
  for (const nlohmann::ordered_json& row : rows) {
    std::vector<std::string> cells;
    for (const auto& [key, value] : row.items()) {
      if (table.rows.empty()) table.columns.push_back({.name = key, .is_text = value.is_string()});
      cells.push_back(value.is_null()           ? "-"
                      : value.is_number_float() ? fmt::format("{:.{}g}", value.get<double>(), digits)
                      : value.is_string()       ? value.get<std::string>()
                      : value.is_boolean()      ? (value.get<bool>() ? "yes" : "no")
                                                : value.dump());
    }
    cells.resize(table.columns.size());
    table.rows.push_back(std::move(cells));
  }
  return table;
}

}  // namespace dynamic_slam
