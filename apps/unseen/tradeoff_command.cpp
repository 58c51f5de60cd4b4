// unseen tradeoff: what each way to simplify costs and shows, for somebody's own model and view.
#include <algorithm>
#include <cmath>
#include <memory>

#include <unseen/session_gpu/tradeoff.h>

#include "cut_report.h"
#include "output_files.h"
#include "progress_bar.h"
#include "report.h"
#include "session_options.h"
#include "terminal.h"
#include "verbs.h"

namespace unseen::app {
namespace {

struct TradeoffArguments {
    ViewOptions& view;
    DisplayOptions& display;
    std::string model = {}, json = {}, csv = {};
    session::TradeoffOptions options = {};
};

// What selects the point in simplify, render and view.
std::string options_of(const session::TradeoffPoint& point) {
    const session::Request& request = point.request;
    std::string text;
    switch (request.goal.kind) {
    case session::Goal::Kind::full: return "--full";
    case session::Goal::Kind::budget: return "--triangles " + std::to_string(request.goal.triangles);
    case session::Goal::Kind::pixels: text = "--pixels " + shortest(request.goal.tolerance_px); break;
    case session::Goal::Kind::quality:
        const session::QualityFacts* const named = session::named_quality(request.goal);
        text = "--quality " + (named ? std::string(named->name) : shortest(request.goal.cost));
        break;
    }
    if (request.fold_test) text += " --fold-test " + session::name_of(*request.fold_test);
    if (point.is_of_view) text += " --visibility picture";
    return text;
}

Json to_json(const session::TradeoffPoint& p) {
    return {{"name", p.name},
            {"options", options_of(p)},
            {"holds_for", p.is_of_view ? "this view" : "all views"},
            {"triangles", p.triangles},
            {"make_ms", p.make_ms},
            {"follow_ms", number_or_null(p.follow_ms.median)},
            {"follow_ms_from", number_or_null(p.follow_ms.low)},
            {"follow_ms_to", number_or_null(p.follow_ms.high)},
            {"draw_ms", p.draw_ms.median},
            {"draw_ms_from", p.draw_ms.low},
            {"draw_ms_to", p.draw_ms.high},
            {"visible_pixels", p.visible_pixels},
            {"v", number_or_null(p.v)},
            {"second_visible_pixels", p.second_visible_pixels},
            {"second_v", number_or_null(p.second_v)},
            {"ssim", number_or_null(p.ssim)},
            {"shift_m", p.shift},
            {"pareto", p.is_on_front},
            {"recommended", p.is_recommended}};
}

std::string to_csv(const session::Tradeoff& tradeoff) {
    std::string text =
        "name,options,triangles,make_ms,follow_ms,draw_ms,visible_pixels,v,second_visible_pixels,second_v,"
        "ssim,shift_m,pareto,recommended\n";
    for (const session::TradeoffPoint& p : tradeoff.points)
        text += csv_line({p.name, options_of(p), p.triangles, p.make_ms, p.follow_ms.median, p.draw_ms.median,
                          p.visible_pixels, p.v, p.second_visible_pixels, p.second_v, p.ssim, p.shift,
                          int{p.is_on_front}, int{p.is_recommended}});
    return text;
}

std::string timing_text(const session::Timing& ms) {
    if (!std::isfinite(ms.median)) return "-";
    return rounded(ms.median, 2) + " (" + rounded(ms.low, 2) + "-" + rounded(ms.high, 2) + ")";
}

void print(const session::Tradeoff& tradeoff, const session::Session& session, int wanted_samples) {
    std::vector<const session::TradeoffPoint*> sorted;
    for (const session::TradeoffPoint& p : tradeoff.points) sorted.push_back(&p);
    std::ranges::stable_sort(sorted, std::greater<>(), [](const auto* p) { return p->triangles; });
    const auto all = static_cast<double>(std::max<std::uint64_t>(session.triangle_count(), 1));
    std::vector<std::vector<std::string>> rows = {{"", "triangles", "of all", "follow, ms", "draw, ms", "make, ms",
                                                   "visible at, px", "V", "second judge", "V", "SSIM", ""}};
    for (const session::TradeoffPoint* p : sorted)
        rows.push_back({p->name, grouped(p->triangles), rounded(100 * p->triangles / all, 3) + "%",
                        timing_text(p->follow_ms), timing_text(p->draw_ms), rounded(p->make_ms, 3),
                        grouped(p->visible_pixels), rounded(p->v, 2), grouped(p->second_visible_pixels),
                        rounded(p->second_v, 2), std::isfinite(p->ssim) ? rounded(p->ssim, 5) : "-",
                        std::string(p->is_on_front ? "*" : "") + (p->is_recommended ? " <-" : "")});
    print_table(rows);
    print_line("* no other has both fewer triangles and a smaller V. V: the largest difference from the full model, in "
               "thresholds; from 1 on it is seen.");
    print_line("follow and draw: a frame, with one sample a pixel, on this machine; the median, and what half of the "
               "frames took. make: from nothing" +
               (tradeoff.measuring_s > 0.5 ? ", after " + duration(1e3 * tradeoff.measuring_s) +
                                                 " that measured what folds change, once for this model."
                                           : std::string(".")));
    if (tradeoff.samples < wanted_samples)
        print_line("judged with " + std::to_string(tradeoff.samples) + " samples a pixel in place of " +
                   std::to_string(wanted_samples) +
                   ", to keep to the time: V is larger for that. --seconds gives more.");
    std::string left_out;
    for (const std::string& name : tradeoff.left_out) left_out += (left_out.empty() ? "left out: " : "; ") + name;
    if (!left_out.empty()) print_note(left_out);
    const auto best = std::ranges::find_if(tradeoff.points, &session::TradeoffPoint::is_recommended);
    print_line("recommended, as the safe way with the fewest triangles that shows nothing: " + options_of(*best));
    const auto still = std::ranges::find_if(tradeoff.points, [&](const session::TradeoffPoint& p) {
        return p.is_of_view && p.visible_pixels == 0 && p.second_visible_pixels == 0 && p.triangles < best->triangles;
    });
    if (still != tradeoff.points.end()) print_line("for a still of this very view: " + options_of(*still));
}

Result<int> run(TradeoffArguments& a) {
    auto report = open_report(inputs_of(a.model, a.view, a.display), {}, a.json, a.csv);
    if (!report) return report.error();
    auto context = render::Context::headless();
    if (!context) return context.error();
    auto session = open_session(a.model, a.view, a.display);
    if (!session) return session.error();
    Result<session::Tradeoff> tradeoff = session::Tradeoff{};
    {
        ProgressBar bar("measuring");
        a.options.progress = std::ref(bar);
        tradeoff = session::measure_tradeoff(*session, *context, make_view(*session, a.view), a.options);
    }
    if (!tradeoff) return tradeoff.error();
    Json points = Json::array();
    for (const session::TradeoffPoint& point : tradeoff->points) points.push_back(to_json(point));
    if (auto ok = report->write({{"source_triangles", session->triangle_count()},
                                 {"samples", tradeoff->samples},
                                 {"measuring_s", tradeoff->measuring_s},
                                 {"points", std::move(points)},
                                 {"left_out", tradeoff->left_out}},
                                to_csv(*tradeoff));
        !ok)
        return ok.error();
    if (report->is_on_stdout()) return exit_done;
    print_scene(*session);
    print(*tradeoff, *session, a.options.samples);
    print_written({a.csv, a.json});
    return exit_done;
}

} // namespace

Command tradeoff_command(CLI::App& app, Setup& setup) {
    auto a = std::make_shared<TradeoffArguments>(TradeoffArguments{setup.view_options(), setup.display_options()});
    CLI::App* verb =
        app.add_subcommand("tradeoff", "What accuracy costs for a model and a view: which options to take");
    add_model_option(*verb, a->model);
    verb->add_option("--csv", a->csv, "A line for each way")->type_name("FILE.csv");
    add_json_option(*verb, a->json);
    add_value(*verb, "--seconds", a->options.seconds, positive(), "T",
              "Roughly how long to measure; ways that do not fit are left out (default: 45)");
    add_samples_option(*verb, a->options.samples, "64");
    setup.act_in(*verb, Setup::view | Setup::model | Setup::scenes);
    verb->footer("Examples:\n  unseen tradeoff bunny.vdt\n"
                 "  unseen tradeoff part.stl --unit 0.001 --size 1920x1080 --csv tradeoff.csv\n"
                 "  unseen tradeoff museum.glb --observer strict --json -");
    return {verb, [a] { return run(*a); }};
}

} // namespace unseen::app
