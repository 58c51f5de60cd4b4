// Behind what is translucent lies anything in the scene: a fold there may show as much as one on an outline.
#include <unseen/perception/criterion.h>
#include <unseen/perception/internal/cut_rings.h>

#include <unseen/vdtree/builder.h>
#include <unseen/vdtree/cut.h>

#include "measured.h"
#include "testing.h"

namespace unseen::perception::translucency_test {

using vdtree::Cut;
using vdtree::Index;
using vdtree::Mesh;
using vdtree::NodeId;
using vdtree::VertexTree;
using vdtree::View;

// A flat even square of 60 x 60 units whose right half, from x = 2 on, has this alpha, or a texture's texels are not there.
VertexTree square(float alpha_on_the_right, bool is_cut_out = false) {
    constexpr int n = 61;
    Mesh mesh;
    if (is_cut_out) {
        mesh.texture = {60, 60, vdtree::Wrap::clamp, vdtree::Wrap::clamp, {}};
        for (int i = 0; i < 60 * 60; ++i)
            mesh.texture.texels.push_back({160, 160, 160, static_cast<std::uint8_t>(i % 60 < 32 ? 255 : 0)});
    }
    for (int row = 0; row < n; ++row) {
        for (int column = 0; column < n; ++column) {
            mesh.positions.push_back({column - n / 2, row - n / 2, 0});
            if (is_cut_out) mesh.uvs.push_back(glm::vec2(column, row) / 60.0f);
            mesh.colours.push_back({0.4f, 0.4f, 0.4f, column - n / 2 >= 2 ? alpha_on_the_right : 1.0f});
        }
    }
    const auto at = [](int row, int column) { return static_cast<Index>(row * n + column); };
    for (int row = 0; row + 1 < n; ++row) {
        for (int column = 0; column + 1 < n; ++column) {
            mesh.triangles.push_back({at(row, column), at(row, column + 1), at(row + 1, column + 1)});
            mesh.triangles.push_back({at(row, column), at(row + 1, column + 1), at(row + 1, column)});
        }
    }
    return std::move(*require(vdtree::build_tree(mesh.view(), {.prelit = true})));
}

struct Halves {
    int left = 0, right = 0; // triangles well within, away from the open edge, which is an outline
};

Halves inner_triangles(const Cut& cut) {
    Halves count;
    const auto indices = cut.indices();
    for (std::size_t i = 0; i < indices.size(); i += 3) {
        int left = 0, right = 0;
        for (std::size_t k = 0; k < 3; ++k) {
            const glm::dvec3 p = glm::dvec3(cut.tree().positions()[indices[i + k]]) + cut.tree().origin();
            if (std::abs(p.y) > 24 || std::abs(p.x) > 24) continue;
            left += p.x < -4;
            right += p.x > 4;
        }
        count.left += left == 3;
        count.right += right == 3;
    }
    return count;
}

enum class Form { in_distances, safe, by_errors };

Result<vdtree::DistanceCriterion> criterion_of(const VertexTree& tree, const View& view, const FoldTestOptions& options,
                                               Form form) {
    if (form == Form::by_errors) return error_distances(tree, view, options);
    if (form == Form::safe) return luebke_hallen_safe_distances(tree, *bound_cut_rings(tree), view, options);
    return luebke_hallen_distances(tree, view, options);
}

Halves halves_of(const VertexTree& given, Form form) {
    const VertexTree measured = support::measured(given);
    const VertexTree& tree = form == Form::by_errors ? measured : given;
    View view;
    view.width = view.height = 256;
    view.eye = {0, 0, 1968.5 / 4}; // a unit is four pixels
    view.fov_y_degrees = physical_field(Display(), view.height).value();
    FoldTestOptions options;
    options.scene = {0.1f, 0.9f};
    Cut cut(tree);
    const auto criterion = require(criterion_of(tree, view, options, form));
    EXPECT_TRUE(criterion->is_monotone());
    EXPECT_TRUE(cut.follow(*criterion, viewpoint_of(tree, view, options, {}, false)));
    return inner_triangles(cut);
}

class Translucency : public testing::TestWithParam<Form> {};
INSTANTIATE_TEST_SUITE_P(Forms, Translucency, testing::Values(Form::in_distances, Form::safe, Form::by_errors));

TEST_P(Translucency, KeepsWhatTheSceneMayShowThrough) {
    const VertexTree tree = square(0.5f);
    ASSERT_TRUE(vdtree::verify(tree));
    const Halves halves = halves_of(tree, GetParam());
    EXPECT_LT(halves.left, 100);
    EXPECT_EQ(halves.right, 2 * 19 * 48); // all: from 5 to 24, and from -24 to 24
}

TEST_P(Translucency, KeepsWhatShowsBetweenTexels) {
    const VertexTree tree = square(1, true);
    ASSERT_TRUE(vdtree::verify(tree));
    const Halves halves = halves_of(tree, GetParam());
    EXPECT_LT(halves.left, 100);
    EXPECT_EQ(halves.right, 2 * 19 * 48);
}

TEST_P(Translucency, OfOpaqueMeshesIsNone) {
    const VertexTree tree = square(1);
    for (NodeId node = 0; node < tree.interior_count(); ++node)
        EXPECT_EQ(tree.bounds()[node].flags & vdtree::translucent_ring, 0);
    const Halves halves = halves_of(tree, GetParam());
    EXPECT_LT(halves.left, 100);
    EXPECT_LT(halves.right, 100);
}

} // namespace unseen::perception::translucency_test
