#include "bench_table.h"

#include <cstdio>

#include "terminal.h"

namespace unseen::app {
namespace {

bool holds(const BenchRow& row, double bound) { return row.more_is_better ? *row.value >= bound : *row.value <= bound; }

std::string bound_text(const std::optional<double>& bound) { return bound ? rounded(*bound, 4) : ""; }

} // namespace

BenchTable table_of(const std::string& title, const std::vector<BenchRow>& rows) {
    BenchTable table{title, {{"measure", "measured", "unit", "target"}}, {}};
    for (const BenchRow& row : rows) {
        table.rows.push_back({row.name, row.value ? with_decimals(*row.value, row.decimals) : "not available", row.unit,
                              bound_text(row.target.must ? row.target.must : row.target.aim)});
        if (!row.note.empty()) table.notes.push_back(row.name + ": " + row.note);
    }
    return table;
}

void print(const BenchTable& table, TableStyle style) {
    if (!table.title.empty()) print_line(table.title), print_line("");
    if (style == TableStyle::aligned) print_table(table.rows);
    else print_markdown(table.rows);
    if (!table.notes.empty()) std::printf("\n");
    for (const std::string& note : table.notes) print_line((style == TableStyle::markdown ? "- " : "") + note);
}

Json to_json(const std::vector<BenchRow>& rows) {
    Json json = Json::array();
    const auto bound = [](const std::optional<double>& value) {
        return value ? number_or_null(*value) : Json(nullptr);
    };
    const auto held = [](const BenchRow& row, const std::optional<double>& value) {
        return row.value && value ? Json(holds(row, *value)) : Json(nullptr);
    };
    for (const BenchRow& row : rows)
        json.push_back({{"name", row.name},
                        {"value", bound(row.value)},
                        {"unit", row.unit},
                        {"must", bound(row.target.must)},
                        {"aim", bound(row.target.aim)},
                        {"holds_must", held(row, row.target.must)},
                        {"holds_aim", held(row, row.target.aim)},
                        {"note", row.note}});
    return json;
}

} // namespace unseen::app
