// What ends a program while it works.
#include "interruption.h"

#include <thread>
#include <vector>

#include <unseen/vdtree/builder.h>
#include <unseen/vdtree/internal/atomic_file.h>
#include <unseen/vdtree/tree_io.h>

#include "shapes.h"
#include "temp_folder.h"
#include "testing.h"

namespace interruption_test {

using namespace unseen;

// Pages of a tree that several threads read in place, after another program has cut its file: one message all the same.
void read_what_was_cut(const std::filesystem::path& file, const std::filesystem::path& output) {
    const auto tree = vdtree::map_tree(file);
    auto out = vdtree::AtomicFile::create(output);
    if (!tree || !out) std::exit(7);
    app::clean_up_on_signals();
    std::filesystem::resize_file(file, 0);
    std::vector<std::jthread> readers;
    for (int i = 0; i < 4; ++i)
        readers.emplace_back([&tree] {
            float sum = 0;
            for (const glm::vec3& p : tree->positions()) sum += p.x;
            std::exit(sum == sum ? 8 : 9);
        });
}

TEST(LostPagesDeathTest, AreSaidAndLeaveNothingBehind) {
    const support::TempFolder folder;
    const auto tree = require(vdtree::build_tree(shapes::bumpy_sphere(4).view()));
    const std::filesystem::path file = folder / "gr\x1b.vdt";
    ASSERT_TRUE(vdtree::write_tree(file, *tree));
    GTEST_FLAG_SET(death_test_style, "threadsafe");
    EXPECT_EXIT(read_what_was_cut(file, folder / "out.ply"), testing::ExitedWithCode(1),
                "unseen: '.*/gr\\..vdt' was cut short or changed while it was read: write it anew");
    EXPECT_EQ(folder.file_count(), 1u) << "not even what was being written";
}

} // namespace interruption_test
