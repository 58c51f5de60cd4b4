// Fits of displays: matches by eye, and photometers' tables.
#include <unseen/calibration/display_profile.h>

#include "profile_files.h"

namespace unseen::calibration::display_fit_test {

class DisplayFit : public ProfileFiles {};

TEST_F(DisplayFit, MatchesGiveTheGamma) {
    for (const double gamma : {1.8, 2.2, 2.6}) {
        std::vector<BrightnessMatch> matches;
        for (const double white : {0.25, 0.5, 0.75})
            matches.push_back({white, std::round(255 * std::pow(white, 1 / gamma)) / 255});
        const auto fitted = require(fit_gamma(matches));
        EXPECT_NEAR(*fitted, gamma, 0.02); // codes are whole
    }
    EXPECT_FALSE(fit_gamma({}));
    for (const BrightnessMatch bad :
         {BrightnessMatch{0, 0.5}, {0.5, 1}, {0.5, 0}, {0.5, std::nan("")}, {0.5, 0.99}, {0.5, 0.1}})
        EXPECT_FALSE(fit_gamma(std::vector{bad})) << bad.white << " " << bad.code;
}

TEST_F(DisplayFit, APhotometersTableBecomesTheDisplay) {
    std::string text = "# dark room\ncode,cdm2\n";
    const auto luminance = [](double code) { return 0.3 + 179.7 * std::pow(code, 2.3); };
    for (int code = 0; code <= 255; code += 15)
        text += std::to_string(code) + "," + std::to_string(luminance(code / 255.0)) + "\n";
    const auto table = require(read_photometer(write(text, "p.csv")));
    const auto from_spreadsheet = require(read_photometer(write("\xef\xbb\xbf"
                                                                "code,cdm2\r\n0,0.5\r\n128,20\r\n255,80\r\n",
                                                                "bom.csv")));
    EXPECT_EQ(from_spreadsheet->luminance, std::vector<double>({0.5, 20, 80}));
    const auto display = require(with_photometer(perception::Display(), *table));
    EXPECT_NEAR(display->peak.value(), 180, 1e-4);
    EXPECT_NEAR(display->black.value(), 0.3, 1e-4);
    const auto levels = code_luminances(*display);
    for (int code = 0; code <= 255; code += 15)
        EXPECT_NEAR(levels[static_cast<std::size_t>(code)], luminance(code / 255.0), 1e-4) << code;
    for (std::size_t i = 1; i < levels.size(); ++i) EXPECT_GT(levels[i], levels[i - 1]);
    // Ambient light is in the photometer's figures already.
    perception::Display lit;
    lit.ambient = perception::Lux(100);
    EXPECT_NEAR(perception::black_level(*require(with_photometer(lit, *table))).value(), 0.3, 1e-4);
}

TEST_F(DisplayFit, BadTablesNameTheFileAndTheLine) {
    const std::pair<std::string, const char*> cases[] = {
        {"", "fewer than 3 rows"},
        {"code;cdm2\n", "line 1: the first line"},
        {"code,cdm2\n0,0.5\nx,2\n", "line 3: must be a code"},
        {"code,cdm2\n0,0.5\n5\n", "line 3: must be a code"},
        {"code,cdm2\n0,nan\n", "line 2: must be a code"},
        {"code,cdm2\n0,-1\n", "line 2: the luminance"},
        {"code,cdm2\n1,0.5\n", "line 2: the first code must be 0"},
        {"code,cdm2\n0,0.5\n300,2\n", "line 3: the code"},
        {"code,cdm2\n0,0.5\n128,20\n100,30\n", "line 4: the codes must ascend"},
        {"code,cdm2\n0,0.5\n128,20\n255,20\n", "line 4: the luminances must ascend"},
        {"code,cdm2\n0,0.5\n255,20\n", "fewer than 3 rows"},
        {"code,cdm2\n0,0.5\n128,20\n250,30\n", "the last code must be 255"},
    };
    for (const auto& [text, expected] : cases)
        EXPECT_THAT(error_in(read_photometer(write(text, "bad.csv"))), AllOf(HasSubstr("bad.csv"), HasSubstr(expected)))
            << text;
    EXPECT_FALSE(read_photometer(folder() / "missing.csv"));
    const auto black = require(read_photometer(write("code,cdm2\n0,0\n128,20\n255,100\n")));
    EXPECT_FALSE(with_photometer(perception::Display(), *black)) << "a display needs some black";
}

} // namespace unseen::calibration::display_fit_test
