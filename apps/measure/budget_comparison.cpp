// Two ways to spend one triangle budget, side by side: node extent, and the perceptual fold test.
//
// After figure 5 of Luebke and Hallen 2001. Prints, for each: the visible pixels against the full model, the largest
// visibility, and the share of triangles with a corner within four pixels of the full model's contour.
#include <cmath>
#include <cstdio>
#include <string>

#include <CLI/CLI.hpp>
#include <glm/geometric.hpp>

#include <perception/criterion.h>
#include <perception/judge.h>
#include <render/renderer.h>
#include <vdtree/builder.h>
#include <vdtree/cut.h>
#include <vdtree/mesh_io.h>
#include <vdtree/tree_io.h>

#include "canvas.h"

namespace {

using namespace unseen;

constexpr int contour_reach_px = 4;

template <class T>
T expect(Result<T> result) {
    if (result) return std::move(*result);
    std::fprintf(stderr, "%s\n", result.error().message.c_str());
    std::exit(1);
}

vdtree::VertexTree load(const std::string& file) {
    if (vdtree::is_tree_file(file)) return expect(vdtree::read_tree(file));
    return expect(vdtree::build_tree(expect(vdtree::read_mesh(file)).mesh.view()));
}

class Comparison {
public:
    Comparison(const vdtree::VertexTree& tree, glm::dvec3 direction)
        : tree_(tree), context_(expect(render::Context::headless())),
          renderer_(expect(render::Renderer::create(context_, tree))) {
        vdtree::View window;
        window.fov_y_degrees = physical_field(display_, window.height).value();
        const vdtree::Sphere sphere = tree.bounding_sphere();
        view_ = vdtree::frame_sphere(tree.origin() + glm::dvec3(sphere.centre), sphere.radius, direction, 0.9, window);
        const auto background = static_cast<float>(to_relative(display_, perception::Luminance(20)));
        draw_options_.background = background;
        options_.display = display_;
        options_.scene = {std::min(background, tree.luminance_range().lo),
                          std::max(background, tree.luminance_range().hi)};
        vdtree::Cut full(tree);
        full.unfold_all();
        reference_ = luminance(full);
        near_contour_ = mark_contour(full);
    }

    // Prints a row, and returns the wireframe as code values.
    perception::Image run(const char* name, const vdtree::DistanceCriterion& criterion, vdtree::Index budget) {
        vdtree::Cut cut(tree_);
        vdtree::FollowOptions following;
        following.triangle_budget = budget;
        const vdtree::AdjustStats stats =
            expect(cut.follow(criterion, perception::viewpoint_of(tree_, view_, options_, {}, false), following));
        perception::JudgeOptions judge;
        judge.display = display_;
        const perception::Judgement judgement = expect(perception::judge_modern(reference_, luminance(cut), judge));
        std::printf("%-14s %9u triangles %8llu visible pixels   max V %6.2f   at the contour %5.1f%%\n", name,
                    stats.triangles, static_cast<unsigned long long>(judgement.visible_pixels), judgement.max_ratio,
                    100 * contour_share(cut));
        render::DrawOptions wireframe = draw_options_;
        wireframe.wireframe = true;
        const render::Frame frame = expect(renderer_.draw(cut, view_, wireframe));
        perception::Image codes{frame.width, frame.height, 3, frame.colour};
        for (float& value : codes.values) value = static_cast<float>(encode(display_, value));
        return codes;
    }

    const vdtree::View& view() const { return view_; }
    const perception::FoldTestOptions& fold_test_options() const { return options_; }

private:
    perception::Image luminance(const vdtree::Cut& cut) {
        const render::Frame frame = expect(renderer_.draw(cut, view_, draw_options_));
        perception::Image image{frame.width, frame.height, 1, frame.luminance};
        for (float& y : image.values) y = static_cast<float>(to_luminance(display_, y).value());
        return image;
    }

    // Pixels within reach of one that the model covers in part, or beside an uncovered one. The share that is uncovered is
    // the difference between a white and a black background.
    std::vector<bool> mark_contour(const vdtree::Cut& full) {
        render::DrawOptions options = draw_options_;
        options.background = 0;
        std::vector<float> uncovered = expect(renderer_.draw(full, view_, options)).luminance;
        for (float& value : uncovered) value = -value;
        options.background = 1;
        const render::Frame white = expect(renderer_.draw(full, view_, options));
        for (std::size_t i = 0; i < uncovered.size(); ++i) uncovered[i] += white.luminance[i];

        const int width = view_.width, height = view_.height;
        const auto at = [&](int x, int y) { return static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x); };
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
                    near[static_cast<std::size_t>(v) * static_cast<std::size_t>(view_.width) + static_cast<std::size_t>(u)] = true;
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
        return near_contour_[static_cast<std::size_t>(y) * static_cast<std::size_t>(view_.width) + static_cast<std::size_t>(x)];
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
    render::Context context_;
    render::Renderer renderer_;
    vdtree::View view_;
    render::DrawOptions draw_options_;
    perception::FoldTestOptions options_;
    perception::Image reference_;
    std::vector<bool> near_contour_;
};

} // namespace

int main(int argc, char** argv) {
    CLI::App app{"Compares node extent and the perceptual fold test at one triangle budget.\n"
                 "Example: unseen_budget_comparison horse.vdt --triangles 18000 --direction 1 0 0 -o horse.png"};
    std::string file, output;
    vdtree::Index budget = 18000;
    std::vector<double> direction = {1, 0, 0};
    app.add_option("MODEL", file, "A mesh or a vertex tree")->required();
    app.add_option("-o,--output", output, "The two wireframes side by side, a PNG");
    app.add_option("--triangles", budget, "The budget")->capture_default_str();
    app.add_option("--direction", direction, "From the model towards the eye")->expected(3)->capture_default_str();
    CLI11_PARSE(app, argc, argv);

    const vdtree::VertexTree tree = load(file);
    Comparison comparison(tree, {direction[0], direction[1], direction[2]});
    const vdtree::DistanceCriterion extent = expect(vdtree::extent_criterion(tree, comparison.view(), 1));
    const vdtree::DistanceCriterion perceptual =
        expect(perception::luebke_hallen_distances(tree, comparison.view(), comparison.fold_test_options()));
    const perception::Image left = comparison.run("extent", extent, budget);
    const perception::Image right = comparison.run("luebke-hallen", perceptual, budget);
    if (output.empty()) return 0;

    constexpr int header = 40; // pixels, for the labels
    app::Canvas canvas(left.width + right.width, left.height + header, {1, 1, 1});
    canvas.text(12, 12, "node extent, " + std::to_string(budget) + " triangles", {0, 0, 0}, 2);
    canvas.text(left.width + 12, 12, "perceptual, " + std::to_string(budget) + " triangles", {0, 0, 0}, 2);
    canvas.picture(0, header, left);
    canvas.picture(left.width, header, right);
    if (const auto written = perception::write_image(output, canvas.image()); !written) {
        std::fprintf(stderr, "%s\n", written.error().message.c_str());
        return 1;
    }
}
