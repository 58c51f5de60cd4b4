#include "sheet_report.h"

#include <cmath>
#include <limits>

#include "cut_report.h"
#include "terminal.h"

namespace unseen::app {
namespace {

double visible_pixels(const SheetCut& cut) {
    return cut.judgement ? static_cast<double>(cut.judgement->visible_pixels)
                         : std::numeric_limits<double>::quiet_NaN();
}

std::string metres(double value) { return rounded(value, 3) + (std::isfinite(value) ? " m" : ""); }

} // namespace

Json sheet_json(const std::vector<SheetCut>& cuts) {
    Json list = Json::array();
    for (const SheetCut& cut : cuts) {
        Json json = {{"name", cut.name}};
        json.update(to_json(cut.report, cut.draw_ms));
        json["visible_pixels"] = number_or_null(visible_pixels(cut));
        json["pixels"] = cut.pixels;
        json["max_ratio"] = cut.judgement ? number_or_null(cut.judgement->max_ratio) : Json(nullptr);
        list.push_back(std::move(json));
    }
    return {{"cuts", list}};
}

void print_sheet(const std::vector<SheetCut>& cuts) {
    std::vector<std::vector<std::string>> rows = {
        {"cut", "triangles", "nodes tested", "adapted in", "drawn in", "visible px", "imperceptible from"}};
    for (const SheetCut& cut : cuts) {
        const session::Report& s = cut.report;
        rows.push_back({cut.name, grouped(s.stats.triangles), grouped(s.stats.node_tests), duration(s.adapt_ms),
                        duration(cut.draw_ms), cut.judgement ? grouped(cut.judgement->visible_pixels) : "reference",
                        metres(s.imperceptible_from_m)});
    }
    print_table(rows);
}

void print_sheet_effects(const std::vector<SheetCut>& cuts) {
    print_line("effects that ran");
    for (const SheetCut& cut : cuts) {
        std::string list;
        for (const session::Effect& effect : cut.report.effects)
            if (effect.on) list += (list.empty() ? "" : ", ") + effect.name;
        print_line("  " + cut.name + ": " + list);
    }
}

} // namespace unseen::app
