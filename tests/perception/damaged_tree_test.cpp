// Damaged tree files, mapped: what perception makes of whole trees fails with the node or section, and nowhere else.

#include <unseen/perception/fold_measurement.h>
#include <unseen/perception/internal/chroma.h>
#include <unseen/perception/internal/cut_rings.h>
#include <unseen/vdtree/tree_io.h>

#include "built.h"
#include "shapes.h"
#include "temp_folder.h"
#include "testing.h"
#include "textures.h"
#include "tree_file.h"

namespace unseen::perception {

using namespace vdtree;

namespace damaged_tree_test {

using support::TreeFile;

TEST(DamagedTrees, AreMeasuredByNobody) {
    const support::TempFolder folder;
    const std::filesystem::path file = folder / "tree.vdt";
    Mesh coloured = shapes::with_attributes(shapes::bumpy_sphere(2)), textured = coloured;
    textured.texture = textures::noise(8, 8, 1);
    std::mt19937_64 random(5);
    for (const Mesh& mesh : {shapes::bumpy_sphere(2), coloured, textured}) {
        ASSERT_TRUE(write_tree(file, support::built(mesh)));
        const TreeFile honest = TreeFile::parse(support::read_bytes(file));
        int damaged = 0, harmless = 0;
        for (int round = 0; round < 120; ++round) {
            TreeFile lying = honest;
            TreeFile::Section& s = lying.sections[random() % lying.sections.size()];
            if (s.name == "facts" || s.name == "ranges" || s.data.empty()) continue;
            s.data[random() % s.data.size()] ^= static_cast<char>(1u << (random() % 8));
            support::write_bytes(file, lying.bytes());
            const auto tree = map_tree(file);
            if (!tree) continue;
            const auto rings = bound_cut_rings(*tree); // first: nobody has looked at the tree yet
            const bool is_sound = tree->check().has_value();
            EXPECT_EQ(rings.has_value(), is_sound) << s.name;
            EXPECT_EQ(ring_chroma(*tree).has_value(), is_sound) << s.name;
            (void)has_chroma(*tree);
            if (!is_sound) {
                EXPECT_FALSE(measure_folds(*tree, 1)) << s.name;
                EXPECT_EQ(rings.error().message, tree->check().error().message);
            }
            ++(is_sound ? harmless : damaged);
        }
        EXPECT_GT(damaged, 15);
        EXPECT_GT(harmless, 5);
    }
}

} // namespace damaged_tree_test
} // namespace unseen::perception
