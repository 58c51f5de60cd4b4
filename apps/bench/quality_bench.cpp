// What budgets show, beside meshoptimizer's simplification with as many triangles.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>

#include <unseen/session_gpu/as_seen.h>
#include <unseen/session_gpu/picture_judge.h>

#include "bench_tools.h"
#include "benches.h"
#include "drawing.h"
#include "judged_model.h"
#include "log_scale.h"
#include "peer_simplify.h"
#include "picture_columns.h"
#include "plot_style.h"
#include "progress_bar.h"
#include "session_options.h"
#include "terminal.h"

namespace unseen::app {
namespace {

constexpr double budgets[] = {0.5, 0.25, 0.1, 0.05, 0.02};
constexpr double budget_of_sheet = 0.05;
constexpr double below_budgets[] = {0.01, 0.005, 0.0025}; // where ours may show what the peer does with more

struct QualityView {
    const char* name;
    glm::dvec3 direction;
    double fill;
};
constexpr QualityView quality_views[] = {
    {"near", {0.5, 0.3, 1}, 0.7}, {"behind", {-0.8, 0.5, -0.6}, 0.7}, {"far", {0.5, 0.3, 1}, 0.1}};

// How a picture differs from the full model's. Less of each is better.
struct Difference {
    double triangles = 0, v = 0, one_minus_ssim = 0, psnr_db = 0;
};

class ViewJudge {
public:
    ViewJudge(const render::Context& context, session::Session& session, const vdtree::View& view)
        : context_(context), session_(session), view_(view),
          judge_(require(session::PictureJudge::create(context, session, view, samples_to_judge))) {}

    Difference of_budget(double share) {
        const auto triangles = static_cast<vdtree::Index>(share * static_cast<double>(session_.triangle_count()));
        const session::Request request{.goal = Goal::budget(std::max(triangles, 1u), true),
                                       .purpose = session::Purpose::picture,
                                       .reasons = false};
        const auto made = require(session::simplify_as_seen(session_, context_, view_, request));
        return difference(judge_.renderer(), made.cuts, made.stats.triangles);
    }
    Difference of_peer(DrawnPeer& peer) {
        return difference(peer.renderer, session::whole_cuts(peer.session),
                          static_cast<double>(peer.session.triangle_count()));
    }

    std::uint64_t all_triangles() const { return session_.triangle_count(); }
    const perception::Image& full() const { return judge_.full_codes(); }
    const perception::Image& shown() const { return shown_; } // what was judged last

private:
    Difference difference(session::SceneRenderer& renderer, std::span<const vdtree::Cut> cuts, double triangles) {
        const auto frame = require(renderer.draw(session::drawn_cuts(cuts), view_, judge_.drawing()));
        const auto verdict = require(judge_.judge(frame));
        shown_ = session::code_image(frame, session_.observer().display);
        double sum = 0;
        for (std::size_t i = 0; i < shown_.values.size(); ++i)
            sum += std::pow(static_cast<double>(shown_.values[i]) - static_cast<double>(full().values[i]), 2);
        return {triangles, std::max(verdict.v, verdict.second_v), 1 - verdict.ssim,
                -10 * std::log10(sum / static_cast<double>(shown_.values.size()))};
    }

    const render::Context& context_;
    session::Session& session_;
    vdtree::View view_;
    session::PictureJudge judge_;
    perception::Image shown_; // code values
};

// How many triangles ours needs to differ as little, by straight lines between logarithms; `ours`: by falling triangles.
double needed(const std::vector<Difference>& ours, double value, double Difference::*of) {
    constexpr double nothing = 1e-9;
    for (std::size_t i = 1; i < ours.size(); ++i) {
        const double fine = std::max(ours[i - 1].*of, nothing), coarse = std::max(ours[i].*of, nothing);
        if (coarse <= value) continue;
        if (fine >= value) return ours[i - 1].triangles;
        const double part = std::log(value / fine) / std::log(coarse / fine);
        return ours[i - 1].triangles * std::pow(ours[i].triangles / ours[i - 1].triangles, part);
    }
    return ours.back().triangles;
}

struct Curves {
    std::string name;
    std::vector<Difference> ours, peer;
};

// Both curves, over triangles.
void draw_curves(const Curves& curves, const std::string& what, double Difference::*of, Drawing& drawing,
                 glm::dvec2 corner, glm::dvec2 size) {
    constexpr glm::vec3 own{0.2f, 0.4f, 0.8f}, other{0.8f, 0.2f, 0}, grid{0.87f};
    constexpr double text_px = 11, heading_px = 13;
    std::vector<double> triangles, values;
    for (const auto* curve : {&curves.ours, &curves.peer})
        for (const Difference& at : *curve) triangles.push_back(at.triangles), values.push_back(at.*of);
    const glm::dvec2 low = corner + glm::dvec2(56, 26), high = corner + size - glm::dvec2(30, 22);
    const LogScale x(triangles, low.x, high.x), y(values, high.y, low.y);
    drawing.text(corner + glm::dvec2(8, 4), curves.name + ": " + what, plot_ink, heading_px);
    for (const double tick : x.ticks()) {
        drawing.line({x.at(tick), low.y}, {x.at(tick), high.y}, grid);
        drawing.text({x.at(tick), high.y + 4}, grouped(static_cast<std::uint64_t>(tick)), plot_ink, text_px,
                     Align::centre);
    }
    for (const double tick : y.ticks()) {
        drawing.line({low.x, y.at(tick)}, {high.x, y.at(tick)}, grid);
        drawing.text({low.x - 5, y.at(tick) - text_px / 2}, rounded(tick, 2), plot_ink, text_px, Align::right);
    }
    const std::pair<const std::vector<Difference>*, glm::vec3> both[] = {{&curves.ours, own}, {&curves.peer, other}};
    for (const auto& [curve, colour] : both) {
        std::vector<glm::dvec2> points;
        for (const Difference& at : *curve) points.emplace_back(x.at(at.triangles), y.at(at.*of));
        if (points.size() > 1) drawing.line(points, colour);
    }
    drawing.text({high.x, low.y}, "Unseen", own, heading_px, Align::right);
    drawing.text({high.x, low.y + 15}, "meshoptimizer", other, heading_px, Align::right);
}

void write_curves(const std::string& file, const std::vector<Curves>& all) {
    constexpr glm::dvec2 size(420, 260);
    auto drawing = require(Drawing::create(2 * static_cast<int>(size.x),
                                           static_cast<int>(size.y) * static_cast<int>(all.size()), plot_paper));
    for (std::size_t i = 0; i < all.size(); ++i) {
        const double top = static_cast<double>(i) * size.y;
        draw_curves(all[i], "1 - SSIM", &Difference::one_minus_ssim, drawing, {0, top}, size);
        draw_curves(all[i], "largest V of both judges", &Difference::v, drawing, {size.x, top}, size);
    }
    require(drawing.write(file));
}

class QualityBench {
public:
    explicit QualityBench(const QualityOptions& options) : options_(options), bar_("judging") {
        table_.columns = {{"model", "model"},
                          {"view", "view"},
                          {"triangles", "triangles"},
                          {"1 - SSIM, 1e-4", "one_minus_ssim"},
                          {"PSNR, dB", "psnr_db"},
                          {"V", "v"},
                          {"meshoptimizer: triangles", "peer_triangles"},
                          {"1 - SSIM, 1e-4", "peer_one_minus_ssim"},
                          {"PSNR, dB", "peer_psnr_db"},
                          {"V", "peer_v"},
                          {"fewer at its SSIM", "fewer_at_ssim"},
                          {"at its V", "fewer_at_v"}};
    }

    BenchReport run() {
        const BenchFolder folder;
        const auto models = options_.inputs.empty() ? make_corner_models(folder) : options_.inputs;
        for (std::size_t i = 0; i < models.size(); ++i) {
            share_ = static_cast<double>(i) / static_cast<double>(models.size());
            step_ = 1.0 / static_cast<double>(models.size() * std::size(quality_views));
            add_model(models[i]);
        }
        for (const auto& [name, factors] : {std::pair("near", &near_), std::pair("far", &far_)})
            if (!factors->empty())
                table_.notes.push_back(std::string(name) + ": meshoptimizer needs " + rounded(median(*factors), 3) +
                                       " times as many triangles for its SSIM or V, in the median");
        if (!has_meshoptimizer()) table_.notes.push_back("this build is without meshoptimizer");
        if (!options_.plot.empty()) write_curves(options_.plot, curves_);
        if (!options_.sheet.empty()) {
            const auto sheet = require(compose_columns("A twentieth of the triangles, as many by both", sheet_));
            require(perception::write_image(options_.sheet, sheet));
        }
        return {{std::move(table_)}};
    }

private:
    void add_model(const std::string& model) {
        ViewOptions options;
        options.as = session::LoadAs::model; // the peer takes one mesh
        options.width = options.height = options_.window_px;
        session::Session session = require(open_session(model, options, {}));
        require(session.prepare(session.default_view(), {.reasons = false}));
        const std::string name = std::filesystem::path(model).filename().string();
        const vdtree::Mesh full = whole_mesh(session.tree());
        std::vector<std::unique_ptr<DrawnPeer>> peers;
        for (const double share : budgets) {
            if (!has_meshoptimizer()) break;
            const double triangles = share * static_cast<double>(full.triangles.size());
            const vdtree::Mesh simple = simplified_by_meshoptimizer(full, static_cast<std::size_t>(triangles), true);
            peers.push_back(simple.triangles.empty() ? nullptr
                                                     : std::make_unique<DrawnPeer>(context_, session, simple));
        }
        for (const QualityView& seen : quality_views) {
            if (options_.quick && &seen != std::begin(quality_views)) break;
            bar_(share_, "");
            share_ += step_;
            options.direction = seen.direction, options.fill = seen.fill;
            add_view(session, name, seen, make_view(session, options), peers);
        }
    }

    void add_view(session::Session& session, const std::string& name, const QualityView& seen, const vdtree::View& view,
                  std::span<const std::unique_ptr<DrawnPeer>> peers) {
        ViewJudge judge(context_, session, view);
        Curves curves{name, {}, {}};
        const bool is_first = &seen == std::begin(quality_views);
        for (const double share : budgets) {
            curves.ours.push_back(judge.of_budget(share));
            if (is_first && share == budget_of_sheet) add_to_sheet(judge, curves.ours.back().triangles, 1);
        }
        for (const double share : below_budgets) curves.ours.push_back(judge.of_budget(share));
        for (std::size_t i = 0; i < std::size(budgets); ++i) {
            std::optional<Difference> theirs;
            if (i < peers.size() && peers[i]) theirs = judge.of_peer(*peers[i]);
            add_row(i == 0 ? name + ", " + seen.name : "", name, seen, curves.ours, i, theirs);
            if (!theirs) continue;
            curves.peer.push_back(*theirs);
            if (is_first && budgets[i] == budget_of_sheet) add_to_sheet(judge, theirs->triangles, 2);
        }
        if (is_first) curves_.push_back(std::move(curves));
    }

    // The full model before the first simplification.
    void add_to_sheet(const ViewJudge& judge, double triangles, std::size_t column) {
        const auto add = [&](const perception::Image& picture, std::size_t to, const std::string& words) {
            sheet_[to].pictures.push_back(picture);
            sheet_[to].verdict += (sheet_[to].verdict.empty() ? "" : "; ") + words;
        };
        if (column == 1) add(judge.full(), 0, grouped(judge.all_triangles()));
        add(judge.shown(), column, grouped(static_cast<std::uint64_t>(triangles)));
    }

    void add_row(const std::string& heading, const std::string& name, const QualityView& seen,
                 const std::vector<Difference>& ours, std::size_t budget, const std::optional<Difference>& theirs) {
        const Difference& own = ours[budget];
        std::vector<Cell> row = {{heading, name},        {seen.name},
                                 count(own.triangles),   number(1e4 * own.one_minus_ssim, 3),
                                 number(own.psnr_db, 3), number(own.v, 2)};
        if (theirs) {
            const double by_ssim =
                theirs->triangles / needed(ours, theirs->one_minus_ssim, &Difference::one_minus_ssim);
            const double by_v = theirs->triangles / needed(ours, theirs->v, &Difference::v);
            auto& factors = seen.fill < 0.5 ? far_ : near_;
            factors.insert(factors.end(), {by_ssim, by_v});
            row.insert(row.end(),
                       {count(theirs->triangles), number(1e4 * theirs->one_minus_ssim, 3), number(theirs->psnr_db, 3),
                        number(theirs->v, 2), number(by_ssim, 2), number(by_v, 2)});
        }
        row.resize(table_.columns.size(), Cell("-", Json()));
        table_.rows.push_back(std::move(row));
    }

    const QualityOptions& options_;
    render::Context context_ = require(render::Context::headless());
    BenchTable table_;
    std::vector<double> near_, far_;                                                           // factors
    std::vector<Curves> curves_;                                                               // of the first view
    std::vector<PictureColumn> sheet_ = {{"full", ""}, {"Unseen", ""}, {"meshoptimizer", ""}}; // likewise
    ProgressBar bar_;
    double share_ = 0, step_ = 0;
};

} // namespace

BenchReport bench_quality(const QualityOptions& options) { return QualityBench(options).run(); }

} // namespace unseen::app
