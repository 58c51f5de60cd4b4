// Tree files with flipped bits, mapped, so that nobody has looked at all of them: whatever is asked of them gives an
// error or stays within the file. Sanitizers see most.
#include <cstddef>
#include <type_traits>

#include <unseen/vdtree/internal/light_bounds.h>
#include <unseen/vdtree/lighting.h>
#include <unseen/vdtree/tree_io.h>

#include "built.h"
#include "kept_arrays.h"
#include "restore.h"
#include "shapes.h"
#include "temp_folder.h"
#include "testing.h"
#include "textures.h"
#include "tree_file.h"
#include "tree_use.h"

namespace unseen::vdtree::damaged_tree_test {

using support::built;
using support::TreeFile;

// Links are given by trees alone that somebody has looked at.
template <class Tree>
concept GivesLinks = requires(const Tree& tree) {
    tree.parents();
}
|| requires(const Tree& tree) { tree.subtree_end(); }
|| requires(const Tree& tree) { tree.first_leaf(); }
|| requires(const Tree& tree) { tree.triangles(); };
static_assert(GivesLinks<SoundTree> && !GivesLinks<VertexTree>);
static_assert(!std::is_constructible_v<SoundTree, VertexTree> && !std::is_assignable_v<SoundTree&, VertexTree>);

struct Kind {
    const char* name;
    VertexTree (*make)();
};

VertexTree marked() {
    const VertexTree tree = built(shapes::bumpy_sphere(2));
    return *tree.with_attribute("mark", AttributeDomain::interior_node,
                                std::vector<float>(tree.interior_count(), 0.5f));
}
VertexTree plain() { return built(shapes::bumpy_sphere(3)); }
VertexTree coloured() { return built(shapes::with_attributes(shapes::bumpy_sphere(3))); }
VertexTree textured() {
    Mesh mesh = shapes::with_attributes(shapes::bumpy_sphere(3));
    mesh.texture = textures::noise(8, 8, 1);
    return built(mesh);
}
VertexTree edged() { return built(shapes::cube(4)); }           // which has several wedges at its edges
VertexTree open_and_large() { return built(shapes::grid(48)); } // in several parts for several threads

class DamagedTrees : public ::testing::TestWithParam<Kind> {
protected:
    Result<VertexTree> mapped(const TreeFile& bytes) {
        support::write_bytes(file_, bytes.bytes());
        return map_tree(file_);
    }
    // Made once.
    const TreeFile& honest() {
        static std::map<std::string, TreeFile> made;
        const auto [at, is_new] = made.try_emplace(GetParam().name);
        if (is_new) {
            if (!write_tree(file_, GetParam().make())) throw std::runtime_error("cannot write the tree");
            at->second = TreeFile::parse(support::read_bytes(file_));
        }
        return at->second;
    }

    support::TempFolder folder_;
    std::filesystem::path file_ = folder_ / "tree.vdt";
};

TEST_P(DamagedTrees, LeadNobodyOutOfBounds) {
    std::mt19937_64 random(5);
    int damaged = 0, harmless = 0;
    for (int round = 0; round < 150; ++round) {
        TreeFile file = honest();
        const std::uint64_t most = round % 2 ? 8 : 1;
        for (std::uint64_t flipped = 0; flipped < most; ++flipped) {
            TreeFile::Section& s = file.sections[random() % file.sections.size()];
            if (s.name == "facts" || s.name == "ranges" || s.data.empty()) continue;
            s.data[random() % s.data.size()] ^= static_cast<char>(1u << (random() % 8));
        }
        const auto tree = mapped(file);
        if (!tree) continue;
        ASSERT_TRUE(support::use_everything(*tree)) << GetParam().name << ", round " << round;
        ++(tree->check() ? harmless : damaged);
    }
    EXPECT_GT(damaged, 30);
    EXPECT_GT(harmless, 10); // normals, flags, luminances and finite values
}

// One parent, which no cut comes by.
TEST_P(DamagedTrees, AreToldWithTheNode) {
    TreeFile file = honest();
    const std::size_t interior = file["first_leaf"].count();
    const auto parent = file["parents"].get<std::uint32_t>(interior - 1);
    file["parents"].set(interior - 1, 0x40000000u);
    const auto tree = require(mapped(file));
    const auto lit = LightBounds::measure(*tree);
    ASSERT_FALSE(lit);
    EXPECT_THAT(lit.error().message, HasSubstr("of the mapped tree is damaged. Build the tree again"));
    EXPECT_FALSE(SoundTree::of(*tree));
    EXPECT_EQ(SoundTree::of(*tree).error().message, lit.error().message);
    EXPECT_THAT(lit.error().message, HasSubstr("Node " + std::to_string(parent)));
}

// What no node's own check looks at.
TEST_P(DamagedTrees, AreToldWithTheSection) {
    const auto expect_fault = [&](const char* section, std::size_t at, std::uint32_t bits, const char* what) {
        TreeFile file = honest();
        file[section].set(at, bits);
        const auto tree = require(mapped(file));
        EXPECT_THAT(error_in(SoundTree::of(*tree)), HasSubstr(what)) << section;
    };
    expect_fault("displacement", 1, 0x7fc00000, "displacement has a value that is not finite");
    expect_fault("displacement", 1, 0xbf800000, "displacement is negative");
    expect_fault("ring_range", 1, 0x00000001, "luminance range");
    expect_fault("mask_at", 1, 0xffffffff, "mask");
    expect_fault("source_vertices", 1, 0xffffffff, "source vertex");
}

// Values of a table, by vertex, as writers gather them.
void expect_values_or_error(const VertexTree& tree) {
    Cut cut(tree);
    cut.unfold_ancestors(tree.node_count() / 2);
    const ExtractedMesh extracted = extract_with_sources(cut);
    std::vector<meshio::VertexArray> arrays(1);
    arrays[0] = {.name = "v", .values = std::vector<std::byte>(4 * std::size_t{tree.source_vertex_count()})};
    const auto found = meshio::arrays_of_cut(cut, extracted, arrays);
    if (found) EXPECT_EQ((*found)[0].size(), extracted.wedges.size());
    EXPECT_EQ(meshio::nodes_of(tree, extracted).size(), extracted.wedges.size());
}

// Trees with wedges, or nodes that need others, and the arrays that hold these.
struct Linked {
    const char* name;
    Mesh mesh;
    std::vector<const char*> sections;
};
std::vector<Linked> linked() {
    return {{"wedges", shapes::cube(2), {"several", "extra_wedges", "further", "leaf_ranks", "wedge_ranks"}},
            {"needs", shapes::spiky_star(2), {"needing", "first_need", "needs"}}};
}

// One value of one of the arrays, every one in turn.
TEST(DamagedLinks, LeadNobodyOutOfBounds) {
    const support::TempFolder folder;
    const auto file = folder / "tree.vdt";
    for (const Linked& of : linked()) {
        ASSERT_TRUE(write_tree(file, built(of.mesh)));
        const TreeFile honest = TreeFile::parse(support::read_bytes(file));
        int refused = 0, opened_damaged = 0, harmless = 0;
        for (const char* section : of.sections) {
            const std::size_t count = TreeFile(honest)[section].data.size() / sizeof(std::uint32_t);
            ASSERT_GE(count, 4u) << section;
            for (std::size_t i = 0; i < count; ++i) {
                const auto was = TreeFile(honest)[section].get<std::uint32_t>(i);
                for (const std::uint32_t now : {0u, was - 1, was + 1, was + 7, 0x7fffffffu, 0xffffffffu}) {
                    if (now == was) continue;
                    TreeFile damaged = honest;
                    damaged[section].set(i, now);
                    support::write_bytes(file, damaged.bytes());
                    for (const bool maps : {false, true}) {
                        const auto opened = maps ? map_tree(file) : read_tree(file);
                        if (!opened) {
                            ++refused;
                            EXPECT_THAT(opened.error().message, HasSubstr("Build the tree again")) << section;
                            continue;
                        }
                        ASSERT_TRUE(support::use_everything(*opened)) << section << ' ' << i << ": " << now;
                        expect_values_or_error(*opened);
                        ++(opened->check() ? harmless : opened_damaged);
                    }
                }
            }
        }
        EXPECT_GT(refused, 100) << of.name;
        EXPECT_GT(harmless, 10) << of.name << ": ranks in another order, other needs";
        if (of.name == std::string_view("wedges")) EXPECT_GT(opened_damaged, 100);
    }
}

// Arrays that are there in part, or of another length.
TEST(DamagedLinks, OfOtherLengthsAreRefused) {
    const support::TempFolder folder;
    const auto file = folder / "tree.vdt";
    for (const Linked& of : linked()) {
        ASSERT_TRUE(write_tree(file, built(of.mesh)));
        const TreeFile honest = TreeFile::parse(support::read_bytes(file));
        for (const char* section : of.sections)
            for (const int bytes : {-4, 4, 0}) { // 0: none is left
                TreeFile damaged = honest;
                std::string& data = damaged[section].data;
                data.resize(bytes == 0 ? 0 : data.size() + static_cast<std::size_t>(2 * bytes)); // whole elements
                support::write_bytes(file, damaged.bytes());
                EXPECT_FALSE(read_tree(file)) << section << ' ' << bytes;
                EXPECT_FALSE(map_tree(file)) << section << ' ' << bytes;
            }
    }
}

// Weights of folds and the places that never fold: looked at when the file is opened.
TEST(DamagedProtection, IsRefusedOrLeadsNobodyOutOfBounds) {
    const support::TempFolder folder;
    const auto file = folder / "tree.vdt";
    Mesh mesh = shapes::grid(4);
    for (glm::dvec3& p : mesh.positions) p += 0.1;
    mesh.weights.assign(mesh.positions.size(), 2);
    ASSERT_TRUE(write_tree(file, built(mesh, {.border_weight = never_folds})));
    const TreeFile honest = TreeFile::parse(support::read_bytes(file));
    const auto is_refused = [&](const TreeFile& damaged) {
        support::write_bytes(file, damaged.bytes());
        const auto read = read_tree(file), mapped = map_tree(file);
        EXPECT_EQ(read.has_value(), mapped.has_value());
        return !read || !support::use_everything(*read) || !support::use_everything(*mapped);
    };
    ASSERT_FALSE(is_refused(honest));
    for (std::size_t i = 0; i < TreeFile(honest)["fold_weights"].count(); ++i)
        for (const float now : {0.0f, -1.0f, 1e9f, std::numeric_limits<float>::quiet_NaN(), 3.0f}) {
            TreeFile damaged = honest;
            damaged["fold_weights"].set(i, now);
            EXPECT_EQ(is_refused(damaged), i > 1 || now != 3.0f) << i << ": " << now;
        }
    for (const char* section : {"fold_weights", "locked_positions"}) {
        TreeFile damaged = honest;
        damaged[section].data.resize(2 * damaged[section].element_bytes);
        EXPECT_EQ(is_refused(damaged), section == std::string("fold_weights"));
    }
    TreeFile damaged = honest;
    damaged["locked_positions"].set(1, std::numeric_limits<double>::infinity());
    EXPECT_TRUE(is_refused(damaged));
}

// What passes costs nothing more, and is what was written.
TEST_P(DamagedTrees, AreNotSeenWhereThereAreNone) {
    const auto tree = require(mapped(honest()));
    const auto sound = require(SoundTree::of(*tree));
    EXPECT_EQ(sound->parents().data(), SoundTree::of(*tree)->parents().data());
    EXPECT_EQ(sound->node_count(), tree->node_count());
    EXPECT_TRUE(support::use_everything(*tree));
}

INSTANTIATE_TEST_SUITE_P(All, DamagedTrees,
                         ::testing::Values(Kind{"plain", plain}, Kind{"coloured", coloured}, Kind{"textured", textured},
                                           Kind{"marked", marked}, Kind{"edged", edged}, Kind{"large", open_and_large}),
                         [](const auto& kind) { return kind.param.name; });

} // namespace unseen::vdtree::damaged_tree_test
