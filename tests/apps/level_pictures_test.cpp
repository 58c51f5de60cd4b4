// Pictures of objects alone, put together, against pictures of the whole scene; and selections for cameras of a scene.
#include <unseen/session_gpu/precompute_selections.h>

#include <unseen/session/internal/selections.h>
#include <unseen/session_gpu/internal/level_pictures.h>

#include "gl_test.h"
#include "measured.h"
#include "shapes.h"
#include "temp_folder.h"

namespace level_pictures_test {

using namespace unseen;
using namespace unseen::session;
using LevelPicturesTest = render::testing::GlTest;
using PrecomputeTest = render::testing::GlTest;

const vdtree::VertexTree& body() {
    static const vdtree::VertexTree tree = support::measured(support::built(shapes::bumpy_sphere(5, 0.05)));
    return tree;
}

Session bodies() {
    Scene scene;
    for (const glm::dvec3& at :
         std::vector<glm::dvec3>{{0, 0, -4}, {1.2, 0.3, -6}, {-3, 0, -5}, {5, 0, 2}, {0.5, 0, 6}}) {
        Object& object = scene.objects.emplace_back(Object{body().share()});
        object.placement.translation = at;
    }
    Object& ground = scene.backdrop.emplace_back(Object{support::built(shapes::placed(shapes::grid(12), 30))});
    ground.placement.rotation = glm::angleAxis(-1.5707963, glm::dvec3(1, 0, 0));
    ground.placement.translation = {-15, -1.2, 15};
    auto session = Session::create(std::move(scene));
    EXPECT_TRUE(session) << session.error().message;
    return std::move(*session);
}

vdtree::View ahead() {
    vdtree::View view;
    view.eye = {0, 0, 0}, view.target = {0, 0, -1};
    view.fov_y_degrees = 90, view.width = view.height = 96;
    return view;
}

TEST_F(LevelPicturesTest, PutTogetherAreThePictureOfAll) {
    Session session = bodies();
    auto pictures = require(LevelPictures::create(context(), session));
    ASSERT_GE(pictures->chain(0).size(), 4);
    const auto picture = require(pictures->draw(ahead(), SelectionQuality::ssim));
    ASSERT_EQ(picture->objects.size(), 3u) << "the others are behind";
    for (const std::vector<int>& levels : {std::vector<int>{0, 0, 0}, {3, 1, 2}, {0, 3, 3}, {2, 2, 2}}) {
        std::vector<int> of_all(5, -1);
        for (std::size_t i = 0; i < levels.size(); ++i) of_all[picture->objects[i].object] = levels[i];
        const auto frame = require(pictures->draw_frame(ahead(), of_all));
        const std::vector<float> together = put_together(*picture, levels);
        std::size_t different = 0, covered = 0;
        for (std::size_t i = 0; i < together.size(); ++i) {
            different += together[i] != pictures->value_of(frame->luminance[i], SelectionQuality::ssim);
            covered += together[i] != picture->background[i];
        }
        EXPECT_LE(different, 2u) << "codes are rounded, and a mean of one sample may differ in its last bit";
        EXPECT_GT(covered, 1000u);
    }
}

std::string bytes_of(const std::filesystem::path& file) {
    std::ifstream in(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
}

TEST_F(PrecomputeTest, GoesOnWhereItWasStoppedAndEndsTheSame) {
    const support::TempFolder folder;
    Session session = bodies();
    PrecomputeOptions options{.budget = 40'000, .window_px = 48, .spacing = 4, .depth = 1};
    const auto whole = require(precompute_selections(context(), session, folder / "whole.sel", options));
    EXPECT_GT(whole->cameras, 10u);
    EXPECT_EQ(whole->resumed, 0u);
    int calls = 0;
    options.progress = [&](double share, const char*) {
        EXPECT_GE(share, 0);
        EXPECT_LE(share, 1);
        return ++calls < 4;
    };
    const auto stopped = precompute_selections(context(), session, folder / "parts.sel", options);
    ASSERT_FALSE(stopped);
    EXPECT_EQ(stopped.error().code, ErrorCode::cancelled);
    EXPECT_FALSE(std::filesystem::exists(folder / "parts.sel"));
    options.progress = {};
    options.threads = 1;
    EXPECT_EQ(require(precompute_selections(context(), session, folder / "parts.sel", options))->resumed, 4u);
    EXPECT_EQ(bytes_of(folder / "parts.sel"), bytes_of(folder / "whole.sel"));
    EXPECT_EQ(folder.file_count(), 2u) << "what was done until then is gone";
}

TEST_F(PrecomputeTest, PartsCellsWhereCornersDiffer) {
    const support::TempFolder folder;
    Session session = bodies();
    PrecomputeOptions options{.budget = 40'000, .window_px = 32, .spacing = 5, .depth = 2, .differ = 0.3};
    ASSERT_TRUE(precompute_selections(context(), session, folder / "fine.sel", options));
    options.differ = 100;
    ASSERT_TRUE(precompute_selections(context(), session, folder / "coarse.sel", options));
    const auto fine = require(read_selections(folder / "fine.sel"));
    const auto coarse = require(read_selections(folder / "coarse.sel"));
    EXPECT_GT(fine->corners.size(), coarse->corners.size());
    double area = 0, of_grid = 0;
    for (const SelectionCell& cell : fine->cells) area += std::pow(cell.size, 2);
    for (const SelectionCell& cell : coarse->cells) of_grid += std::pow(cell.size, 2);
    EXPECT_EQ(area, of_grid) << "the parts of a cell cover it";
}

TEST_F(PrecomputeTest, OfSpaceHasSixDirectionsAndCanBeFollowed) {
    const support::TempFolder folder;
    Session session = bodies();
    const PrecomputeOptions options{.budget = 40'000, .window_px = 32, .spacing = 8, .depth = 0, .is_in_space = true};
    ASSERT_TRUE(precompute_selections(context(), session, folder / "space.sel", options));
    const auto selections = require(read_selections(folder / "space.sel"));
    EXPECT_EQ(selections->directions(), 6);
    auto pictures = require(LevelPictures::create(context(), session));
    auto follower = require(SelectionFollower::create(Selections(*selections), session.scene(), pictures->triangles()));
    for (int i = 0; i < 40; ++i) {
        vdtree::View view = ahead();
        view.eye = {0, 0.1 * i, 0.2 * i}, view.target = view.eye + glm::dvec3(std::sin(0.2 * i), 0, -std::cos(0.2 * i));
        const auto chosen = require(follower->choose(view));
        EXPECT_TRUE(chosen->holds);
        EXPECT_LE(chosen->triangles, 40'000u);
    }
}

TEST_F(PrecomputeTest, RefusesOptionsOutOfRange) {
    const support::TempFolder folder;
    Session session = bodies();
    const auto complaint = [&](const PrecomputeOptions& options) {
        const auto done = precompute_selections(context(), session, folder / "a.sel", options);
        return done ? "it was done" : done.error().message;
    };
    EXPECT_THAT(complaint({}), HasSubstr("budget"));
    EXPECT_THAT(complaint({.budget = 1, .window_px = 8}), HasSubstr("window"));
    EXPECT_THAT(complaint({.budget = 1, .spacing = std::nan("")}), HasSubstr("spacing"));
    EXPECT_THAT(complaint({.budget = 1, .spacing = 1e-6}), HasSubstr("spacing"));
    EXPECT_THAT(complaint({.budget = 1, .depth = 99}), HasSubstr("parted"));
    EXPECT_THAT(complaint({.budget = 1, .low = glm::dvec3(1), .high = glm::dvec3(0)}), HasSubstr("box"));
    EXPECT_EQ(folder.file_count(), 0u);
}

} // namespace level_pictures_test
