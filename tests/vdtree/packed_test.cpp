// What a tree stores in few bits: shares, directions, and normal masks.

#include <unseen/vdtree/internal/normal_mask.h>
#include <unseen/vdtree/vertex_tree.h>

#include "shapes.h"
#include "testing.h"
#include "tree/mask_pool.h"

namespace unseen::vdtree::packed_test {

TEST(Unorm16, RoundsToTheNearest) {
    for (int value = 0; value <= 65535; ++value) {
        const Unorm16 y{static_cast<std::uint16_t>(value)};
        ASSERT_EQ(Unorm16::nearest(y), y);
        ASSERT_EQ(Unorm16::nearest((value + 0.49) / 65535), y);
        ASSERT_EQ(Unorm16::nearest((value - 0.49) / 65535), y);
        if (value > 0)
            ASSERT_GT(static_cast<float>(y), static_cast<float>(Unorm16{static_cast<std::uint16_t>(value - 1)}));
    }
    EXPECT_EQ(static_cast<float>(Unorm16{0}), 0.0f);
    EXPECT_EQ(static_cast<float>(Unorm16{65535}), 1.0f);
}

TEST(Unorm16, TakesAnyNumber) {
    constexpr double inf = std::numeric_limits<double>::infinity();
    EXPECT_EQ(Unorm16::nearest(std::nan("")).value, 0);
    EXPECT_EQ(Unorm16::nearest(-inf).value, 0);
    EXPECT_EQ(Unorm16::nearest(-1e-300).value, 0);
    EXPECT_EQ(Unorm16::nearest(inf).value, 65535);
    EXPECT_EQ(Unorm16::nearest(1.1).value, 65535);
}

TEST(PackedNormal, StaysNearTheDirection) {
    std::mt19937_64 random(1);
    for (int i = 0; i < 100'000; ++i) {
        glm::dvec3 n = shapes::random_direction(random);
        if (i % 3 == 0) n[i % 9 / 3] *= 1e-5, n = glm::normalize(n); // near the octahedron's edges
        const glm::vec3 back = PackedNormal::nearest(glm::vec3(n));
        ASSERT_LT(glm::distance(glm::dvec3(back), n), 6.6e-5) << n.x << ' ' << n.y << ' ' << n.z;
        ASSERT_NEAR(glm::length(glm::dvec3(back)), 1, 3e-7);
    }
}

TEST(PackedNormal, KeepsTheAxes) {
    for (int axis = 0; axis < 3; ++axis) {
        for (const float sign : {-1.0f, 1.0f}) {
            glm::vec3 n(0);
            n[axis] = sign;
            EXPECT_EQ(glm::vec3(PackedNormal::nearest(n)), n);
            EXPECT_EQ(glm::vec3(PackedNormal::nearest(n * 1e-38f)), n);
            EXPECT_EQ(glm::vec3(PackedNormal::nearest(n * 3e38f)), n);
        }
    }
}

// Whatever a file says is a unit vector or zero.
TEST(PackedNormal, UnpacksAnyBits) {
    std::mt19937_64 random(2);
    for (int i = 0; i < 100'000; ++i) {
        const std::uint64_t bits = random();
        const auto edge = [](std::uint64_t b) {
            const std::int16_t values[] = {-32768, -32767, 0, 32767};
            return b % 8 < 4 ? values[b % 4] : static_cast<std::int16_t>(b);
        };
        const glm::vec3 n = PackedNormal{edge(bits), edge(bits >> 32)};
        ASSERT_TRUE(n == glm::vec3(0) || std::abs(glm::length(n) - 1) < 1e-6f);
    }
}

NormalMask random_mask(std::mt19937_64& random) {
    NormalMask mask;
    const std::uint64_t cells = random() % 5 ? random() % 12 : random() % 600;
    const auto first = static_cast<int>(random() % normal_cell_count);
    const int spread = 1 + static_cast<int>(random() % 60);
    for (std::uint64_t i = 0; i < cells; ++i)
        mask.insert((first + static_cast<int>(random() % static_cast<unsigned>(spread))) % normal_cell_count);
    return mask;
}

TEST(MaskPool, GivesBackEveryMask) {
    std::mt19937_64 random(3);
    NormalMask all;
    all.faces.fill(~std::uint64_t{0});
    std::vector<Directions> nodes(2);
    nodes[1].mask = all;
    for (int i = 0; i < 20'000; ++i) nodes.emplace_back().mask = random_mask(random);
    const std::size_t different = nodes.size();
    for (std::size_t i = 0; i < different; i += 3) nodes.push_back(nodes[i]);
    const PooledMasks pool = pool_masks(nodes, std::vector<NodeId>(nodes.size(), 0));
    ASSERT_EQ(pool.at.size(), nodes.size());
    for (std::size_t i = 0; i < nodes.size(); ++i) ASSERT_EQ(unpack_mask(pool.records, pool.at[i]), nodes[i].mask);
    for (std::size_t i = different; i < nodes.size(); ++i)
        ASSERT_EQ(pool.at[i], pool.at[(i - different) * 3]) << "equal masks share";
}

TEST(MaskPool, ReadsAnyBytes) {
    std::mt19937_64 random(4);
    NormalMask all;
    all.faces.fill(~std::uint64_t{0});
    for (int i = 0; i < 10'000; ++i) {
        std::vector<std::uint8_t> bytes(random() % 200); // its own allocation: AddressSanitizer sees the end
        for (std::uint8_t& b : bytes) b = static_cast<std::uint8_t>(random() % 4 ? 255 : random());
        const std::size_t at = random() % 8 ? random() % 256 : ~std::size_t{0} - random() % 3;
        const NormalMask mask = unpack_mask(bytes, at);
        if (bytes.size() < most_mask_bytes || at > bytes.size() - most_mask_bytes) ASSERT_EQ(mask, all);
    }
}

} // namespace unseen::vdtree::packed_test
