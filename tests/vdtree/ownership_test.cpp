// What outlives what: callbacks in options, the tree of a cut, and the value of a failed Result.

#include <unseen/meshio/mesh_file.h>
#include <unseen/vdtree/builder.h>
#include <unseen/vdtree/cut.h>

#include "shapes.h"
#include "testing.h"

namespace unseen::vdtree {
namespace {

// Options that were made in a scope which is left by the time the callback is called.
template <class Options>
Options with_progress(std::shared_ptr<int> calls) {
    Options options;
    options.progress = [kept = std::move(calls)](double, const char*) { return ++*kept > 0; };
    return options;
}

template <class Options>
class OptionsOwn : public testing::Test {};
using AllOptions = testing::Types<BuildOptions, meshio::ReadOptions>;
TYPED_TEST_SUITE(OptionsOwn, AllOptions);

TYPED_TEST(OptionsOwn, TheirProgress) {
    auto calls = std::make_shared<int>(0);
    std::optional<TypeParam> options = with_progress<TypeParam>(calls);
    EXPECT_EQ(calls.use_count(), 2);
    EXPECT_TRUE(options->progress(0, ""));
    const TypeParam copy = *options;
    EXPECT_EQ(calls.use_count(), 3);
    options.reset();
    EXPECT_EQ(calls.use_count(), 2);
    EXPECT_TRUE(copy.progress(1, ""));
    EXPECT_EQ(*calls, 2);
}

TEST(OptionsOwn, WhatABuildTells) {
    auto calls = std::make_shared<int>(0);
    ASSERT_TRUE(build_tree(shapes::bumpy_sphere(2).view(), with_progress<BuildOptions>(calls)));
    EXPECT_GT(*calls, 0);
    EXPECT_EQ(calls.use_count(), 1);
}

TEST(CutOwns, AHandleOfItsTree) {
    auto tree = require(build_tree(shapes::bumpy_sphere(2).view(), {.threads = 1}));
    std::optional<VertexTree> first = std::move(*tree);
    const VertexTree::Data* const data = &first->data();
    const Index triangles = first->triangle_count();
    Cut cut(*first);
    first.reset();
    cut.unfold_all();
    EXPECT_EQ(cut.triangle_count(), triangles);
    EXPECT_EQ(&cut.tree().data(), data);
}

// In every build: not undefined, and not silent.
TEST(ResultDeathTest, EndsTheProgramWithTheSentenceOfItsError) {
    const Result<int> failed = Error{ErrorCode::io_failure, "The file 'a.ply' is gone."};
    EXPECT_DEATH(static_cast<void>(failed.value()), "The file 'a.ply' is gone\\.");
    EXPECT_DEATH(static_cast<void>(*failed), "The file 'a.ply' is gone\\.");
    const Result<std::string> other = Error{ErrorCode::io_failure, "Nothing is left."};
    EXPECT_DEATH(static_cast<void>(other->size()), "Nothing is left\\.");
    const Result<int> good = 5;
    EXPECT_EQ(good.value(), 5);
}

} // namespace
} // namespace unseen::vdtree
