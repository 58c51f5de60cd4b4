// Cuts that follow viewpoints, options and criteria at random, over small trees: see follow_drive.h.

#include "follow_drive.h"
#include "testing.h"

namespace unseen::vdtree::follow_property_test {

// Runs; more with the environment variable UNSEEN_RUNS.
unsigned run_count() {
    const char* asked = std::getenv("UNSEEN_RUNS");
    return asked ? static_cast<unsigned>(std::atoi(asked)) : 300;
}

std::vector<std::uint8_t> random_bytes(unsigned seed, std::size_t count) {
    std::mt19937 random(seed);
    std::vector<std::uint8_t> bytes(count);
    for (std::uint8_t& byte : bytes) byte = static_cast<std::uint8_t>(random());
    return bytes;
}

TEST(FollowProperty, HoldsWhateverComes) {
    constexpr std::size_t bytes_a_run = 4000; // some for the criteria, most for sixty steps
    for (unsigned seed = 0; seed < run_count(); ++seed)
        ASSERT_EQ(support::FollowDrive(random_bytes(seed, bytes_a_run)).run(), "") << "seed " << seed;
}

TEST(FollowProperty, HoldsWhenTheBytesEndAnywhere) {
    for (unsigned seed = 0; seed < 100; ++seed)
        ASSERT_EQ(support::FollowDrive(random_bytes(seed, 3 * seed)).run(), "") << "seed " << seed;
}

} // namespace unseen::vdtree::follow_property_test
