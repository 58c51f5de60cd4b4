// The window over which the judge sums energy, against the law of area.
#include "judge/summation.h"
#include "testing.h"

namespace unseen::perception::summation_test {

// The mean of w over discs, w = Ac / (Ac + pi r^2)^2, is the law of area.
TEST(SummationWindow, HoldsOfDiscsWhatTheLawOfAreaSays) {
    constexpr int side = 301;
    for (const double area : {20.0, 90.0, 744.0, 3000.0}) {
        const SummationWindow window(area);
        for (const double share_of_area : {0.1, 0.3, 1.0, 2.0}) {
            Plane disc(side, side);
            const double radius = std::sqrt(share_of_area * area / std::numbers::pi);
            double covered = 0;
            for (int y = 0; y < side; ++y) {
                for (int x = 0; x < side; ++x) {
                    const bool is_inside = std::hypot(x - side / 2, y - side / 2) < radius;
                    disc.row(y)[x] = is_inside ? 1 : 0;
                    covered += is_inside;
                }
            }
            const double at_middle = window.sums(disc).row(side / 2)[side / 2];
            EXPECT_NEAR(at_middle / (covered / (covered + area)), 1, 0.12) << area << " samples, " << share_of_area;
        }
    }
}

TEST(SummationWindow, LosesNothingOfAPlane) {
    Plane plane(257, 255);
    std::fill(plane.values.begin(), plane.values.end(), 2.0f);
    EXPECT_NEAR(SummationWindow(300).sums(plane).row(127)[128], 2, 1e-3);
    // Elsewhere it sums to what was there.
    Plane point(257, 255);
    point.row(100)[90] = 1;
    double sum = 0;
    for (const float v : SummationWindow(300).sums(point).values) sum += static_cast<double>(v);
    EXPECT_NEAR(sum, 1, 0.02);
}

} // namespace unseen::perception::summation_test
