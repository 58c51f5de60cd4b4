#include "bench_table.h"

#include <array>
#include <cstdio>

#include "terminal.h"

namespace unseen::app {
namespace {

bool holds(const BenchRow& row, double bound) {
    return row.more_is_better ? *row.value >= bound : *row.value <= bound;
}

std::string fixed(double value, int decimals) {
    std::array<char, 64> text;
    std::snprintf(text.data(), text.size(), "%.*f", decimals, value);
    return text.data();
}

std::string bound_text(const std::optional<double>& bound) {
    return bound ? rounded(*bound, 4) : "";
}

std::string verdict(const BenchRow& row) {
    if (!row.value || (!row.must && !row.aim)) return "";
    if (row.aim && holds(row, *row.aim)) return "aim";
    if (!row.must) return "not yet";
    return holds(row, *row.must) ? "must" : "NO";
}

} // namespace

void print(const std::string& title, const std::vector<BenchRow>& rows) {
    std::printf("%s\n\n", title.c_str());
    std::vector<std::vector<std::string>> table = {{"measure", "measured", "unit", "must", "aim", "holds"}};
    for (const BenchRow& row : rows)
        table.push_back({row.name, row.value ? fixed(*row.value, row.decimals) : "not available", row.unit, bound_text(row.must),
                         bound_text(row.aim), verdict(row)});
    print_table(table);
    std::printf("\n");
    for (const BenchRow& row : rows)
        if (!row.note.empty()) std::printf("%s: %s\n", row.name.c_str(), row.note.c_str());
}

Json to_json(const std::vector<BenchRow>& rows) {
    Json json = Json::array();
    const auto bound = [](const std::optional<double>& value) { return value ? number_or_null(*value) : Json(nullptr); };
    const auto held = [](const BenchRow& row, const std::optional<double>& value) {
        return row.value && value ? Json(holds(row, *value)) : Json(nullptr);
    };
    for (const BenchRow& row : rows)
        json.push_back({{"name", row.name},
                        {"value", bound(row.value)},
                        {"unit", row.unit},
                        {"must", bound(row.must)},
                        {"aim", bound(row.aim)},
                        {"holds_must", held(row, row.must)},
                        {"holds_aim", held(row, row.aim)},
                        {"note", row.note}});
    return json;
}

} // namespace unseen::app
