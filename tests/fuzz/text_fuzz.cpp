// Fuzz target for what people and other programs write down: profiles of displays, observers and lights, sensitivities,
// a calibration that goes on, studies and their answers, recorded gazes, camera paths, tables of photometers. Any bytes,
// after one that chooses the reader, must give an error with a message, or something valid. tests/README.md tells how to
// build and run it.
#include <cstdlib>
#include <span>
#include <string_view>

#include <unseen/calibration/calibration.h>
#include <unseen/calibration/internal/people.h>
#include <unseen/perception/gaze.h>

#include "camera_path.h"
#include "memory_file.h"
#include "target.h"

namespace {

using namespace unseen;

// Errors say something; what is read has passed `is_valid`.
template <class T, class F>
bool expect(const Result<T>& read, F&& is_valid) {
    if (read ? !is_valid(*read) : read.error().message.empty()) std::abort();
    return read.has_value();
}
constexpr auto anything = [](const auto&) { return true; };

bool read_as(unsigned reader, const std::filesystem::path& file) {
    switch (reader) {
    case 0:
        return expect(calibration::read_display(file),
                      [](const auto& d) { return perception::validate(d).has_value(); });
    case 1: return expect(calibration::read_csf(file), anything);
    case 2: return expect(calibration::read_observer(file), anything);
    case 3: return expect(calibration::LightRig::read(file), anything);
    case 4: return expect(calibration::Procedure::resume(file, perception::CsfTable::standard()), anything);
    case 5: return expect(calibration::read_sensitivities(file), anything);
    case 6:
        return expect(calibration::read_study(file), [](const auto& study) {
            return calibration::validate(study).has_value() && !calibration::trials_of(study, "x").empty();
        });
    case 7: return expect(calibration::analyse_answers(std::span(&file, 1)), anything);
    case 8:
        return expect(perception::read_gaze_recording(file),
                      [](const auto& recording) { return !recording.trace.samples().empty(); });
    case 9:
        return expect(app::CameraPath::read(file.string(), {0, 1, 0}),
                      [](const auto& path) { return !path.poses_from(vdtree::View()).empty(); });
    case 10: return expect(calibration::read_photometer(file), anything);
    default: return false;
    }
}
constexpr unsigned readers = 11;

} // namespace

bool fuzz::accepts(std::string_view bytes) {
    if (bytes.empty()) return false;
    static MemoryFile file;
    file.hold(bytes.substr(1));
    return read_as(static_cast<unsigned char>(bytes[0]) % readers, file.path());
}
