#include "cut_report.h"

#include <cmath>
#include <limits>
#include <map>
#include <string_view>
#include <tuple>
#include <utility>

#include "option_names.h"
#include "terminal.h"

namespace unseen::app {
namespace {

bool is_whole(const session::Report& s) {
    return s.stats.triangles == s.source_triangles && s.stats.max_fold_cost == 0;
}

// Each once, in the order of the first, with how many objects have it.
std::vector<std::pair<const session::Effect*, std::size_t>> merged(std::span<const session::Effect> effects) {
    std::vector<std::pair<const session::Effect*, std::size_t>> all;
    std::map<std::tuple<std::string_view, bool, std::string_view>, std::size_t> places;
    for (const session::Effect& effect : effects) {
        const auto [place, is_new] = places.try_emplace({effect.name, effect.on, effect.why}, all.size());
        if (is_new) all.push_back({&effect, 0});
        ++all[place->second].second;
    }
    return all;
}

Json to_json(const session::CheckFacts& c) {
    return {{"cost", c.cost},
            {"most_v", c.most_v},
            {"cell_degrees", c.cell_degrees},
            {"fitted_views", c.fitted_views},
            {"verified_views", c.verified_views},
            {"v", c.v},
            {"second_v", c.second_v},
            {"looks", c.looks},
            {"rounds", c.rounds},
            {"seconds", c.seconds},
            {"settled", c.is_settled}};
}

// "by both judges, in 8 other views (V .83 and .87)".
std::string checked_text(const session::CheckFacts& c) {
    if (c.verified_views == 0)
        return c.cost > 0 ? "by both judges in " + std::to_string(c.fitted_views) +
                                " views by which it was found, not verified in others"
                          : "whatever is folded shows: this is the full model";
    std::string text = c.most_v <= 1 ? "neither judge sees a difference"
                                     : "both judges see no more than " + rounded(c.most_v, 3) + " thresholds";
    text += " in " + std::to_string(c.verified_views) +
            (c.cell_degrees > 0 ? " other views within " + rounded(c.cell_degrees, 3) + " degrees of this one"
                                : " other pictures of this view, shifted by parts of a pixel") +
            " (V " + rounded(c.v, 2) + " and " + rounded(c.second_v, 2) + ")";
    return text + (c.is_settled ? "" : "; fewer triangles might do as well");
}

} // namespace

Json to_json(const session::Report& s, double draw_ms) {
    const double cost = vdtree::is_unbounded(s.stats.max_fold_cost) ? std::numeric_limits<double>::infinity()
                                                                    : static_cast<double>(s.stats.max_fold_cost);
    Json json = {{"source_triangles", s.source_triangles},
                 {"triangles", s.stats.triangles},
                 {"dropped", s.dropped},
                 {"node_tests", s.stats.node_tests},
                 {"adapt_ms", number_or_null(s.adapt_ms)},
                 {"extract_ms", number_or_null(s.extract_ms)},
                 {"draw_ms", number_or_null(draw_ms)},
                 {"imperceptible_from_m", number_or_null(s.imperceptible_from_m)},
                 {"max_fold_cost", number_or_null(cost)},
                 {"effects", to_json(s.effects)}};
    if (!s.passes.empty()) json["passes"] = passes_to_json(s.passes);
    if (s.check) json["check"] = to_json(*s.check);
    return json;
}

Json passes_to_json(std::span<const session::Effect> passes) {
    Json list = Json::array();
    for (const session::Effect& e : passes)
        list.push_back({{"name", e.name},
                        {"on", e.on},
                        {"why", e.why},
                        {"surface_passes", e.surface_passes},
                        {"texture_bytes", e.texture_bytes},
                        {"ms", e.milliseconds}});
    return list;
}

void add_scene(Json& json, const session::Session& session, std::span<const vdtree::Cut> cuts) {
    const session::Scene& scene = session.scene();
    json["as"] = scene.is_of_file() ? "scene" : "model";
    if (!scene.objects.empty()) json["tree"] = name_of(scene.objects[0].origin);
    if (!scene.is_of_file()) return;
    Json objects = Json::array();
    for (std::size_t i = 0; i < cuts.size(); ++i)
        objects.push_back({{"name", scene.objects[i].name},
                           {"node", scene.objects[i].node},
                           {"mesh", scene.objects[i].mesh},
                           {"source_triangles", scene.objects[i].tree.triangle_count()},
                           {"triangles", cuts[i].triangle_count()}});
    std::uint64_t backdrop = 0;
    for (const session::Object& part : scene.backdrop) backdrop += part.tree.triangle_count();
    json["objects"] = std::move(objects);
    json["backdrop_triangles"] = backdrop;
}

void print_scene(const session::Session& session) {
    const session::Scene& scene = session.scene();
    if (!scene.is_of_file()) return;
    const auto counted = [](std::size_t count, const char* what) {
        return grouped(count) + " " + what + (count == 1 ? "" : "s");
    };
    print_line("a scene of " + counted(scene.objects.size(), "object") +
               (scene.backdrop.empty() ? std::string()
                                       : ", before " + counted(scene.backdrop.size(), "part") + " of background"));
}

std::string triangles_text(std::uint64_t triangles, std::uint64_t source_triangles) {
    if (source_triangles == 0) return "no triangles";
    const double percent = 100.0 * static_cast<double>(triangles) / static_cast<double>(source_triangles);
    return grouped(triangles) + " of " + grouped(source_triangles) + " triangles (" +
           rounded(percent, percent > 99 ? 4 : 2) + "%)";
}

std::string kept_text(std::uint64_t triangles, std::uint64_t source_triangles) {
    return "kept " + triangles_text(triangles, source_triangles);
}

std::string seen_from_text(const session::Report& s, const perception::Display& display) {
    const double from_m = s.imperceptible_from_m;
    if (is_whole(s)) return "nothing is folded";
    if (std::isnan(from_m))
        return "whether anybody sees a difference is not known: the fold test " +
               session::name_of(s.fold_tests.front()) + " counts pixels";
    constexpr double rounding = 1 + 1e-6;
    if (from_m <= display.distance.value() * rounding)
        return "nobody sees a difference, looked at from " + rounded(from_m, 3) + " m or more";
    if (std::isfinite(from_m))
        return "a difference can be seen; looked at from " + rounded(from_m, 3) + " m or more, nobody sees it";
    return "a difference can be seen from any distance";
}

std::string visibility_text(const session::Report& s, const session::Observer& observer, const DisplayOptions& display,
                            const std::string& where) {
    std::string text = s.check ? checked_text(*s.check) : seen_from_text(s, observer.display);
    if (is_whole(s) || (!s.check && std::isnan(s.imperceptible_from_m))) return text;

    const bool is_default_display =
        display.file.empty() && !display.pixels_per_degree && !display.peak_cdm2 && !display.black_cdm2;
    const session::FoldTest test = s.fold_tests.front();
    if (s.check) text += ": by pictures";
    else
        text += ": by the model (fold test " + session::name_of(test) +
                (session::facts_of(test).is_safe ? "" : ", which misses some changes") + "), which can be wrong";
    text += ", for " + describe(observer) + (s.check ? "" : ", " + where) + ", on " +
            (is_default_display ? "the default display" : "this display") + ", ";
    if (!observer.gaze) return text + "wherever they look";
    const auto tenths = [](double px) { return shortest(std::round(10 * px) / 10); };
    return text + "with the gaze at pixel " + tenths(observer.gaze->px.x) + " " + tenths(observer.gaze->px.y);
}

void print_details(const session::Report& s, double draw_ms) {
    std::vector<std::vector<std::string>> rows = {{"dropped triangles", grouped(s.dropped)},
                                                  {"nodes tested", grouped(s.stats.node_tests)},
                                                  {"adapted in", duration(s.adapt_ms)},
                                                  {"extracted in", duration(s.extract_ms)}};
    if (!std::isnan(draw_ms)) rows.push_back({"drawn in", duration(draw_ms)});
    print_table(rows);
    print_line("effects");
    print(s.effects);
    print_passes(s.passes);
}

void print_passes(std::span<const session::Effect> passes) {
    if (passes.empty()) return;
    print_line("pictures drawn for it");
    for (const session::Effect& e : passes)
        print_line("  " + e.name + (e.on ? ": on, " : ": off, ") + e.why +
                   (e.surface_passes == 0
                        ? std::string()
                        : "; " + grouped(static_cast<std::uint64_t>(e.surface_passes)) + " drawings, " +
                              file_size(e.texture_bytes) + ", " + duration(e.milliseconds)));
}

Json to_json(std::span<const session::Effect> effects) {
    Json json = Json::array();
    for (const auto& [effect, objects] : merged(effects)) {
        json.push_back({{"name", effect->name}, {"on", effect->on}, {"why", with_option_names(effect->why)}});
        if (objects > 1) json.back()["objects"] = objects;
    }
    return json;
}

void print(std::span<const session::Effect> effects) {
    for (const auto& [effect, objects] : merged(effects))
        print_line(std::string(effect->on ? "  on   " : "  off  ") + effect->name + ": " +
                   with_option_names(effect->why) +
                   (objects > 1 ? " (" + grouped(objects) + " objects)" : std::string()));
}

} // namespace unseen::app
