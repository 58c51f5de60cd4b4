#include "cut_report.h"

#include <cmath>
#include <cstdio>
#include <limits>

#include "option_names.h"
#include "terminal.h"

namespace unseen::app {

Json to_json(const session::Report& s, double draw_ms) {
    const double cost = vdtree::is_unbounded(s.stats.max_fold_cost) ? std::numeric_limits<double>::infinity()
                                                                    : static_cast<double>(s.stats.max_fold_cost);
    return {{"source_triangles", s.source_triangles},
            {"triangles", s.stats.triangles},
            {"dropped", s.dropped},
            {"node_tests", s.stats.node_tests},
            {"adapt_ms", number_or_null(s.adapt_ms)},
            {"extract_ms", number_or_null(s.extract_ms)},
            {"draw_ms", number_or_null(draw_ms)},
            {"imperceptible_from_m", number_or_null(s.imperceptible_from_m)},
            {"max_fold_cost", number_or_null(cost)},
            {"effects", to_json(s.effects)}};
}

void print(const session::Report& s, double draw_ms) {
    const double share = 100.0 * s.stats.triangles / static_cast<double>(s.source_triangles);
    std::vector<std::vector<std::string>> rows = {
        {"triangles",
         grouped(s.stats.triangles) + " of " + grouped(s.source_triangles) + " (" + rounded(share, 3) + "%)"},
        {"dropped", grouped(s.dropped)},
        {"nodes tested", grouped(s.stats.node_tests)},
        {"adapted in", rounded(s.adapt_ms, 3) + " ms"},
        {"extracted in", rounded(s.extract_ms, 3) + " ms"}};
    if (!std::isnan(draw_ms)) rows.push_back({"drawn in", rounded(draw_ms, 3) + " ms"});
    const std::string metres = std::isfinite(s.imperceptible_from_m) ? " m" : "";
    rows.push_back({"imperceptible from", rounded(s.imperceptible_from_m, 3) + metres});
    print_table(rows);
    std::printf("effects\n");
    print(s.effects);
}

Json to_json(std::span<const session::Effect> effects) {
    Json json = Json::array();
    for (const session::Effect& effect : effects)
        json.push_back({{"name", effect.name}, {"on", effect.on}, {"why", with_option_names(effect.why)}});
    return json;
}

void print(std::span<const session::Effect> effects) {
    for (const session::Effect& effect : effects)
        std::printf("  %-3s  %s: %s\n", effect.on ? "on" : "off", effect.name.c_str(),
                    with_option_names(effect.why).c_str());
}

} // namespace unseen::app
