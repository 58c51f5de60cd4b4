#include "budget_bench.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

#include <glm/geometric.hpp>

#include <unseen/perception/criterion.h>
#include <unseen/perception/judge.h>
#include <unseen/render/renderer.h>
#include <unseen/session_gpu/frame_image.h>
#include <unseen/vdtree/cut.h>

#include "drawing.h"
#include "model_file.h"
#include "terminal.h"

namespace unseen::app {
namespace {

constexpr double model_fill = 0.9; // of the window's height
constexpr double background = 20;  // cd/m2
constexpr int contour_reach_px = 4;

// What one fold test makes of the budget.
struct BudgetUse {
    std::string name;
    vdtree::Index triangles = 0;
    std::uint64_t visible_pixels = 0; // against the full model
    double largest = 0;               // V
    double contour_percent = 0;       // of the triangles
};

class Comparison {
public:
    Comparison(const vdtree::VertexTree& tree, render::Renderer renderer, const BudgetBenchOptions& options)
        : tree_(tree), renderer_(std::move(renderer)) {
        vdtree::View window;
        window.fov_y_degrees = physical_field(display_, window.height).value();
        const vdtree::Sphere sphere = tree.bounding_sphere();
        view_ = vdtree::frame_sphere(tree.origin() + glm::dvec3(sphere.centre), sphere.radius, options.direction,
                                     model_fill, window);
        if (options.up) view_.up = *options.up;
        const auto relative = static_cast<float>(to_relative(display_, perception::Luminance(background)));
        draw_options_.background = relative;
        options_.display = display_;
        options_.scene = {std::min(relative, tree.luminance_range().lo), std::max(relative, tree.luminance_range().hi)};
    }

    // The full model, which the others are compared with. To be called first.
    Result<void> draw_reference() {
        vdtree::Cut full(tree_);
        full.unfold_all();
        const auto frame = renderer_.draw(full, view_, draw_options_);
        if (!frame) return frame.error();
        reference_ = session::luminance_image(*frame, display_);
        auto marked = mark_contour(full);
        if (!marked) return marked.error();
        near_contour_ = std::move(*marked);
        return {};
    }

    struct Spent {
        BudgetUse use;
        perception::Image wireframe; // code values
    };
    Result<Spent> spend(std::string name, const vdtree::DistanceCriterion& criterion, vdtree::Index budget) {
        vdtree::Cut cut(tree_);
        const auto followed = cut.follow(criterion, perception::viewpoint_of(tree_, view_, options_, {}, false),
                                         {.triangle_budget = budget});
        if (!followed) return followed.error();
        const vdtree::AdjustStats stats = *followed;
        const auto frame = renderer_.draw(cut, view_, draw_options_);
        if (!frame) return frame.error();
        perception::JudgeOptions judge;
        judge.display = display_;
        const auto judgement = perception::judge_modern(reference_, session::luminance_image(*frame, display_), judge);
        if (!judgement) return judgement.error();
        render::DrawOptions wired = draw_options_;
        wired.wireframe = true;
        const auto wireframe = renderer_.draw(cut, view_, wired);
        if (!wireframe) return wireframe.error();
        return Spent{{std::move(name), stats.triangles, judgement->visible_pixels, judgement->max_ratio,
                      100 * contour_share(cut)},
                     session::code_image(*wireframe, display_)};
    }

    const vdtree::View& view() const { return view_; }
    const perception::FoldTestOptions& fold_test_options() const { return options_; }

private:
    // Pixels within reach of one that the model covers in part, or beside an uncovered one. The share that is uncovered
    // is the difference between a white and a black background.
    Result<std::vector<bool>> mark_contour(const vdtree::Cut& full) {
        render::DrawOptions options = draw_options_;
        options.background = 0;
        const auto black = renderer_.draw(full, view_, options);
        if (!black) return black.error();
        options.background = 1;
        const auto white = renderer_.draw(full, view_, options);
        if (!white) return white.error();
        std::vector<float> uncovered;
        for (std::size_t i = 0; i < white->luminance.size(); ++i)
            uncovered.push_back(white->luminance[i] - black->luminance[i]);

        const int width = view_.width, height = view_.height;
        const auto at = [&](int x, int y) {
            return static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
        };
        constexpr float least_share = 1e-3f; // below half a sample in 256, above the rounding of the difference
        std::vector<bool> near(uncovered.size(), false);
        for (int y = 0; y < height; ++y) {
            for (int x = 0; x < width; ++x) {
                const bool covered = uncovered[at(x, y)] < 1 - least_share;
                bool contour = covered && uncovered[at(x, y)] > least_share;
                for (const auto& [dx, dy] : {std::pair(1, 0), std::pair(-1, 0), std::pair(0, 1), std::pair(0, -1)}) {
                    const int u = x + dx, v = y + dy;
                    if (u < 0 || v < 0 || u >= width || v >= height) continue;
                    contour |= covered && uncovered[at(u, v)] > 1 - least_share;
                }
                if (contour) mark_disc(near, x, y);
            }
        }
        return near;
    }

    void mark_disc(std::vector<bool>& near, int x, int y) const {
        for (int dy = -contour_reach_px; dy <= contour_reach_px; ++dy) {
            for (int dx = -contour_reach_px; dx <= contour_reach_px; ++dx) {
                const int u = x + dx, v = y + dy;
                const bool in_reach = dx * dx + dy * dy <= contour_reach_px * contour_reach_px;
                if (in_reach && u >= 0 && v >= 0 && u < view_.width && v < view_.height)
                    near[static_cast<std::size_t>(v) * static_cast<std::size_t>(view_.width) +
                         static_cast<std::size_t>(u)] = true;
            }
        }
    }

    bool is_near_contour(vdtree::NodeId vertex, const vdtree::CameraFrame& frame) const {
        const glm::dvec3 p = tree_.origin() + glm::dvec3(tree_.positions()[vertex]) - view_.eye;
        const double depth = -glm::dot(p, frame.back), scale = pixels_per_radian(view_);
        if (!(depth > 0)) return false;
        const double x = view_.width * 0.5 + scale * glm::dot(p, frame.right) / depth;
        const double y = view_.height * 0.5 - scale * glm::dot(p, frame.up) / depth;
        if (!(x >= 0 && y >= 0 && x < view_.width && y < view_.height)) return false;
        return near_contour_[static_cast<std::size_t>(y) * static_cast<std::size_t>(view_.width) +
                             static_cast<std::size_t>(x)];
    }

    double contour_share(const vdtree::Cut& cut) const {
        const vdtree::CameraFrame frame = camera_frame(view_);
        const auto indices = cut.indices();
        std::size_t near = 0;
        for (std::size_t i = 0; i < indices.size(); i += 3)
            near += is_near_contour(indices[i], frame) || is_near_contour(indices[i + 1], frame) ||
                    is_near_contour(indices[i + 2], frame);
        return indices.empty() ? 0 : static_cast<double>(near) / (static_cast<double>(indices.size()) / 3);
    }

    const vdtree::VertexTree& tree_;
    perception::Display display_;
    render::Renderer renderer_;
    vdtree::View view_;
    render::DrawOptions draw_options_;
    perception::FoldTestOptions options_;
    perception::Image reference_; // cd/m2
    std::vector<bool> near_contour_;
};

Result<void> write_picture(const std::string& file, const Comparison::Spent& left, const Comparison::Spent& right) {
    constexpr int header = 40, margin = 12, text_height = 17; // pixels
    constexpr glm::vec3 paper{1.0f}, ink{0.0f};
    auto drawing = Drawing::create(left.wireframe.width + right.wireframe.width, left.wireframe.height + header, paper);
    if (!drawing) return drawing.error();
    int x = 0;
    for (const Comparison::Spent* one : {&left, &right}) {
        drawing->text({x + margin, margin}, one->use.name + ", " + grouped(one->use.triangles) + " triangles", ink,
                      text_height);
        drawing->picture({x, header}, one->wireframe);
        x += one->wireframe.width;
    }
    return drawing->write(file);
}

BudgetBenchResult result_of(const std::vector<BudgetUse>& uses) {
    BudgetBenchResult result;
    result.table.rows = {{"fold test", "triangles", "visible pixels", "largest V", "at the contour"}};
    for (const BudgetUse& use : uses) {
        result.table.rows.push_back({use.name, grouped(use.triangles), grouped(use.visible_pixels),
                                     rounded(use.largest, 3), rounded(use.contour_percent, 3) + "%"});
        result.tests.push_back({{"fold_test", use.name},
                                {"triangles", use.triangles},
                                {"visible_pixels", use.visible_pixels},
                                {"max_ratio", number_or_null(use.largest)},
                                {"contour_percent", use.contour_percent}});
    }
    return result;
}

} // namespace

Result<BudgetBenchResult> bench_budget(const BudgetBenchOptions& options) {
    auto context = render::Context::headless();
    if (!context) return context.error();
    const auto tree = load_tree(options.mesh);
    if (!tree) return tree.error();
    auto renderer = render::Renderer::create(*context, *tree);
    if (!renderer) return renderer.error();
    Comparison comparison(*tree, std::move(*renderer), options);
    if (auto drawn = comparison.draw_reference(); !drawn) return drawn.error();
    const auto extent = vdtree::extent_criterion(*tree, comparison.view(), 1);
    if (!extent) return extent.error();
    const auto perceptual =
        perception::luebke_hallen_distances(*tree, comparison.view(), comparison.fold_test_options());
    if (!perceptual) return perceptual.error();
    const vdtree::Index triangles = options.triangles.of(tree->triangle_count());
    const auto left = comparison.spend("extent", *extent, triangles);
    if (!left) return left.error();
    const auto right = comparison.spend("luebke-hallen", *perceptual, triangles);
    if (!right) return right.error();
    if (!options.picture.empty())
        if (auto written = write_picture(options.picture, *left, *right); !written) return written.error();
    return result_of({left->use, right->use});
}

} // namespace unseen::app
