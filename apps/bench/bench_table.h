// What a benchmark found out: tables for people, and the same as JSON for programs.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "report.h"

namespace unseen::app {

// What people read, and what JSON has.
struct Cell {
    Cell(std::string words) : text(std::move(words)), json(text) {}
    Cell(const char* words) : Cell(std::string(words)) {}
    Cell(std::string words, Json value) : text(std::move(words)), json(std::move(value)) {}

    std::string text;
    Json json;
};
Cell count(double value);              // "69,666"
Cell number(double value, int digits); // significant ones
Cell fixed(double value, int decimals);
Cell percent(double share, int digits);

struct BenchTable {
    struct Column {
        std::string heading;
        std::string key = {}; // of JSON, which has the column only with one
    };

    // Each row as an object.
    void add_to(Json& rows) const;

    std::string title = {};
    std::vector<Column> columns = {};
    std::vector<std::vector<Cell>> rows = {};
    std::vector<std::string> notes = {};
};

// One line of a table of what was measured beside what was promised.
struct BenchRow {
    std::string name, unit;
    std::optional<double> value; // not set: not available, see the note
    int decimals = 0;
    std::optional<double> target = {}; // in the value's unit
    std::string note = {};
    std::optional<double> machine_ms = {}; // what a fixed loop took beside it, so that runs compare
};
BenchTable table_of(const std::string& title, const std::vector<BenchRow>& rows);
Json to_json(const std::vector<BenchRow>& rows);

struct BenchReport {
    std::vector<BenchTable> tables = {};
    Json json = Json::object(); // beside the rows of tables whose columns have keys
};

// To stdout: aligned for terminals, or as Markdown for pages.
enum class TableStyle { aligned, markdown };
void print(const BenchTable& table, TableStyle style);

} // namespace unseen::app
