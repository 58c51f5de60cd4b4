#include <unseen/perception/internal/judge_tables.h>

#include "judge/band_weights.h"
#include "judge/judge_input.h"
#include "judge/modern_masking.h"
#include "judge/summation.h"
#include "pyramid_kernel.h"

namespace unseen::perception {

Result<JudgeTables> judge_tables(int width, int height, float darkest_cdm2, float brightest_cdm2,
                                 const JudgeOptions& options) {
    if (auto ok = check(options); !ok) return ok.error();
    if (width < 1 || height < 1) return judge_argument_error("judge", "a picture has one pixel or more");
    if (!(darkest_cdm2 >= 0 && darkest_cdm2 <= brightest_cdm2 && std::isfinite(brightest_cdm2)))
        return judge_argument_error("judge", "a picture's luminances ascend from 0 or more, and are finite");
    const BandConditions conditions = conditions_for(width, height, {darkest_cdm2, brightest_cdm2},
                                                     eccentricity_range(width, height, options), options);
    JudgeTables tables;
    tables.width = width, tables.height = height;
    tables.floor_cdm2 = static_cast<float>(contrast_floor(options.display));
    tables.beta = static_cast<float>(options.beta);
    tables.most_thresholds = most_thresholds(options.beta);
    tables.kernel = {static_cast<float>(kernel_middle), static_cast<float>(kernel_near),
                     static_cast<float>(kernel_far)};
    tables.masking_power = static_cast<float>(masking_knee) * static_cast<float>(masking_slope);
    tables.masking_knee = static_cast<float>(masking_knee);
    tables.least_masker = least_masker, tables.most_masker = most_masker;
    tables.luminance_shift = BandTable::fraction_bits;
    tables.eccentricity_step = static_cast<float>(BandTable::eccentricity_step);
    tables.gaze = gaze_on_screen(width, height, options);
    for (int level = 0; level <= conditions.base_level; ++level) {
        const BandTable band(conditions, level);
        tables.first_luminance = band.first_cell();
        tables.first_eccentricity = band.first_eccentricity();
        tables.luminances = static_cast<int>(band.luminances());
        tables.eccentricities = static_cast<int>(band.eccentricities());
        tables.bands.push_back({nominal_frequency(conditions.ppd, level), static_cast<float>(band.of_patch()),
                                SummationWindow(summation_area_in_samples(conditions, level)).gaussians(),
                                band.nodes()});
    }
    return tables;
}

} // namespace unseen::perception
