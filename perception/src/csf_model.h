// Private to perception: the part of the closed forms that depends on eccentricity. Both models are
// S(rho, e, L) = S(rho, 0, L) 10^(-decay(rho) e), which lets a table be filled without evaluating the rest again.
#pragma once

#include <perception/csf.h>

namespace unseen::perception {

// log10 of the loss of sensitivity per degree of eccentricity; above 0. VisualField::worst is the smaller loss.
double decay_per_degree(CsfModel model, CyclesPerDegree frequency, VisualField field);

// Where the nasal and the temporal field lose sensitivity equally fast: the only kink in frequency of the worst field.
CyclesPerDegree equal_decay_frequency(CsfModel model);

} // namespace unseen::perception
