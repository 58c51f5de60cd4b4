// Private to perception: the closed forms by family, and how they fall apart into factors, which lets a table be filled
// without evaluating all of a form again for every sample.
#pragma once

#include <unseen/perception/csf.h>

namespace unseen::perception {

// ---- castleCSF and stelaCSF (csf_castle.cpp) -----------------------------------------------------------------------

bool is_castle_family(CsfModel model);
// At the fovea, at the stimulus' temporal frequency.
double castle_family_at_fovea(CsfModel model, const Stimulus& stimulus);
// log10 of the loss of sensitivity per degree of eccentricity. VisualField::worst is the smaller loss.
double castle_family_decay(CsfModel model, CyclesPerDegree frequency, VisualField field);
// Where the nasal and the temporal field lose sensitivity equally fast: a kink in frequency of the worst field.
CyclesPerDegree equal_decay_frequency(CsfModel model);
// Where castle's transient channel reaches the lowest temporal frequency that it peaks at: a kink in luminance.
Luminance castle_transient_kink();

// ---- the older models (csf_classical.cpp) --------------------------------------------------------------------------

// At the fovea, static.
double classical_at_fovea(CsfModel model, const Stimulus& stimulus);
// Barten 1989 at one luminance, for many frequencies.
class Barten1989 {
public:
    explicit Barten1989(double cdm2);
    double operator()(double cpd) const;

private:
    double amplitude_, width_;
};
// The shape over frequency only: luminance and area do not matter.
bool is_relative(CsfModel model);
// Daly's model, static, is the smaller of two branches, the first of which knows no eccentricity.
double daly_ceiling(const Stimulus& stimulus);
double daly_eccentric(const Stimulus& stimulus);

// ---- what is common (csf.cpp) --------------------------------------------------------------------------------------

// All models but daly are S(rho, e, L) = S(rho, 0, L) 10^(-decay(rho) e).
double decay_per_degree(CsfModel model, CyclesPerDegree frequency, VisualField field);
// What motion multiplies static sensitivity by; 1 where the model has temporal channels of its own and nothing moves.
double motion_factor(CsfModel model, const Stimulus& stimulus);
// Frequencies at which log S has kinks under these conditions, whatever the luminance and eccentricity.
std::vector<CyclesPerDegree> kinks(CsfModel model, const Stimulus& conditions);

} // namespace unseen::perception
