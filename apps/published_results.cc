#include "published_results.h"

namespace dynamic_slam {
namespace {

// Headings that several tables have; those that are not for the terminal are left out there.
Table::Column Shown(const std::string& group, const std::string& name) {
  return {.name = name, .group = group};
}
Table::Column Wide(const std::string& group, const std::string& name) {
  return {.name = name, .group = group, .on_terminal = false};
}

}  // namespace

const PublishedTable& PublishedTumApe() {
  static const PublishedTable table{
      {Wide("", "Length, m"), Shown("published", "PTAM"), Shown("published", "LSD-SLAM"),
       Shown("published", "SVO"), Shown("published", "DynaSLAM"), Shown("ORB-SLAM2 (paper)", "RMSE"),
       Wide("ORB-SLAM2 (paper)", "Median"), Wide("ORB-SLAM2 (paper)", "Mean"),
       Wide("ORB-SLAM2 (paper)", "Std."), Shown("Dynamic-SLAM (paper)", "RMSE"),
       Wide("Dynamic-SLAM (paper)", "Median"), Wide("Dynamic-SLAM (paper)", "Mean"),
       Wide("Dynamic-SLAM (paper)", "Std."), Shown("Dynamic-SLAM (paper)", "Imp.")},
      {{"fr2_desk_with_person",
        {"17.044", "x", "31.73", "17.14", "0.8", "4.971", "1.829", "2.857", "4.068", "1.873", "0.952",
         "1.277", "1.370", "62.32%"}},
       {"fr3_sitting_halfsphere",
        {"6.503", "x", "5.87", "12.06", "-", "1.992", "1.451", "1.687", "1.059", "1.461", "1.230", "1.290",
         "0.686", "26.66%"}},
       {"fr3_sitting_rpy",
        {"1.110", "-", "-", "7.89", "-", "5.811", "4.709", "5.363", "2.237", "3.448", "3.087", "3.228",
         "3.015", "40.66%"}},
       {"fr3_sitting_xyz",
        {"5.496", "0.83", "7.73", "6.03", "1.3", "0.836", "0.547", "0.731", "0.405", "0.601", "0.565",
         "0.570", "0.190", "28.11%"}},
       {"fr3_walking_halfsphere",
        {"7.686", "x", "x", "11.25", "2.1", "3.714", "2.348", "2.807", "2.432", "2.139", "1.507", "1.823",
         "1.118", "42.41%"}},
       {"fr3_walking_rpy",
        {"2.698", "-", "-", "18.91", "-", "10.528", "6.794", "8.764", "5.833", "6.025", "4.689", "5.385",
         "2.702", "42.77%"}},
       {"fr3_walking_xyz",
        {"5.791", "x", "12.44", "9.30", "1.4", "1.431", "1.082", "1.225", "0.519", "1.324", "0.836", "1.080",
         "0.765", "7.48%"}}}};
  return table;
}

const PublishedTable& PublishedTumRpeTranslation() {
  static const PublishedTable table{
      {Shown("ORB-SLAM2 (paper)", "RMSE"), Wide("ORB-SLAM2 (paper)", "Mean"),
       Wide("ORB-SLAM2 (paper)", "Std."), Shown("Dynamic-SLAM (paper)", "RMSE"),
       Wide("Dynamic-SLAM (paper)", "Mean"), Wide("Dynamic-SLAM (paper)", "Std."),
       Shown("Dynamic-SLAM (paper)", "Imp.")},
      {{"fr2_desk_with_person", {"2.584", "0.975", "2.393", "1.958", "0.946", "1.714", "24.23%"}},
       {"fr3_sitting_halfsphere", {"1.694", "1.254", "1.139", "1.451", "1.236", "1.002", "19.38%"}},
       {"fr3_sitting_rpy", {"6.495", "3.910", "5.185", "4.303", "3.555", "3.092", "33.75%"}},
       {"fr3_sitting_xyz", {"0.948", "0.847", "0.424", "0.998", "0.901", "0.427", "-5.27%"}},
       {"fr3_walking_halfsphere", {"3.795", "2.761", "2.604", "2.192", "1.852", "1.172", "42.24%"}},
       {"fr3_walking_rpy", {"6.776", "4.702", "4.879", "5.605", "4.184", "3.729", "17.28%"}},
       {"fr3_walking_xyz", {"1.772", "1.535", "0.885", "1.796", "1.457", "1.050", "-1.35%"}}}};
  return table;
}

const PublishedTable& PublishedTumRpeRotation() {
  static const PublishedTable table{
      {Shown("ORB-SLAM2 (paper)", "RMSE"), Wide("ORB-SLAM2 (paper)", "Mean"),
       Wide("ORB-SLAM2 (paper)", "Std."), Shown("Dynamic-SLAM (paper)", "RMSE"),
       Wide("Dynamic-SLAM (paper)", "Mean"), Wide("Dynamic-SLAM (paper)", "Std."),
       Shown("Dynamic-SLAM (paper)", "Imp.")},
      {{"fr2_desk_with_person", {"0.891", "0.496", "0.740", "0.833", "0.516", "0.778", "6.51%"}},
       {"fr3_sitting_halfsphere", {"0.581", "0.458", "0.358", "0.551", "0.496", "0.240", "5.16%"}},
       {"fr3_sitting_rpy", {"1.368", "0.999", "0.935", "0.991", "0.807", "0.576", "27.56%"}},
       {"fr3_sitting_xyz", {"0.557", "0.501", "0.243", "0.613", "0.514", "0.335", "-10.05%"}},
       {"fr3_walking_halfsphere", {"0.763", "0.623", "0.439", "0.666", "0.555", "0.368", "12.71%"}},
       {"fr3_walking_rpy", {"1.278", "0.967", "0.835", "1.149", "0.886", "0.732", "10.09%"}},
       {"fr3_walking_xyz", {"1.825", "1.002", "1.526", "0.598", "0.533", "0.272", "67.23%"}}}};
  return table;
}

const PublishedTable& PublishedTimes() {
  static const PublishedTable table{
      {Shown("", "Median"), Shown("", "Mean"), Shown("", "Total")},
      {{"ORB-SLAM2", {"0.050", "0.050", "42.90"}}, {"Dynamic-SLAM", {"0.044", "0.045", "38.40"}}}};
  return table;
}

const PublishedTable& PublishedKittiApe() {
  static const PublishedTable table{
      {Wide("", "Dimension, m"), Shown("published", "ORB-SLAM"), Shown("published", "DynaSLAM"),
       Shown("ORB-SLAM2 (paper)", "RMSE"), Wide("ORB-SLAM2 (paper)", "Mean"),
       Wide("ORB-SLAM2 (paper)", "Median"), Wide("ORB-SLAM2 (paper)", "Std."),
       Shown("Dynamic-SLAM (paper)", "RMSE"), Wide("Dynamic-SLAM (paper)", "Mean"),
       Wide("Dynamic-SLAM (paper)", "Median"), Wide("Dynamic-SLAM (paper)", "Std."),
       Wide("Dynamic-SLAM (paper)", "Scale"), Shown("Dynamic-SLAM (paper)", "Imp.")},
      {{"00",
        {"564 × 496", "6.68", "7.55", "9.579", "8.072", "6.104", "5.157", "4.436", "4.094", "4.031", "1.708",
         "17.16", "53.69%"}},
       {"02",
        {"599 × 946", "21.75", "26.29", "24.842", "19.600", "16.887", "15.263", "20.367", "15.587", "11.642",
         "13.109", "21.71", "18.01%"}},
       {"03",
        {"471 × 199", "1.59", "1.81", "1.078", "0.923", "0.840", "0.556", "0.828", "0.602", "0.427", "0.568",
         "11.42", "23.19%"}},
       {"04",
        {"0.5 × 394", "1.79", "0.97", "1.233", "1.098", "1.072", "0.559", "1.109", "0.983", "1.006", "0.513",
         "35.44", "10.06%"}},
       {"05",
        {"479 × 426", "8.23", "4.60", "5.730", "5.308", "5.456", "2.158", "5.724", "5.365", "5.422", "1.995",
         "21.70", "0.10%"}},
       {"06",
        {"23 × 457", "14.68", "14.74", "15.241", "13.172", "13.884", "7.687", "12.455", "10.911", "11.774",
         "6.007", "23.55", "18.28%"}},
       {"07",
        {"191 × 209", "3.36", "2.36", "1.962", "1.675", "1.425", "1.022", "1.823", "1.652", "1.676", "0.772",
         "11.23", "7.08%"}},
       {"08",
        {"808 × 391", "46.58", "40.28", "30.29", "21.72", "14.63", "21.11", "27.487", "20.754", "16.367",
         "18.022", "16.09", "9.25%"}},
       {"09",
        {"465 × 568", "7.62", "3.32", "10.374", "9.473", "10.395", "4.229", "9.285", "8.416", "10.028",
         "3.923", "21.91", "10.50%"}},
       {"10",
        {"671 × 177", "8.68", "6.78", "9.515", "8.157", "6.879", "4.899", "8.909", "6.889", "5.137", "5.649",
         "16.75", "6.37%"}}}};
  return table;
}

const PublishedTable& PublishedKittiRpeTranslation() {
  static const PublishedTable table{
      {Shown("ORB-SLAM2 (paper)", "RMSE"), Wide("ORB-SLAM2 (paper)", "Mean"),
       Wide("ORB-SLAM2 (paper)", "Std."), Shown("Dynamic-SLAM (paper)", "RMSE"),
       Wide("Dynamic-SLAM (paper)", "Mean"), Wide("Dynamic-SLAM (paper)", "Std."),
       Shown("Dynamic-SLAM (paper)", "Imp.")},
      {{"00", {"7.295", "3.763", "6.207", "6.077", "2.744", "5.422", "16.70%"}},
       {"02", {"4.719", "3.718", "2.906", "4.241", "3.278", "2.692", "10.13%"}},
       {"03", {"3.777", "3.284", "1.866", "3.702", "3.194", "1.871", "1.99%"}},
       {"04", {"0.134", "0.122", "0.055", "0.099", "0.091", "0.037", "26.12%"}},
       {"05", {"10.263", "3.178", "9.759", "8.881", "3.035", "8.346", "13.47%"}},
       {"06", {"1.106", "0.529", "0.971", "0.756", "0.446", "0.610", "31.65%"}},
       {"07", {"2.408", "1.786", "1.617", "2.622", "1.949", "1.754", "-8.89%"}},
       {"08", {"3.861", "3.029", "2.395", "3.819", "2.975", "2.395", "1.09%"}},
       {"09", {"4.152", "3.649", "1.981", "4.107", "3.583", "2.007", "1.08%"}},
       {"10", {"3.564", "3.282", "1.389", "3.517", "3.247", "1.351", "1.32%"}}}};
  return table;
}

const PublishedTable& PublishedKittiRpeRotation() {
  static const PublishedTable table{
      {Shown("ORB-SLAM2 (paper)", "RMSE"), Wide("ORB-SLAM2 (paper)", "Mean"),
       Wide("ORB-SLAM2 (paper)", "Std."), Shown("Dynamic-SLAM (paper)", "RMSE"),
       Wide("Dynamic-SLAM (paper)", "Mean"), Wide("Dynamic-SLAM (paper)", "Std."),
       Shown("Dynamic-SLAM (paper)", "Imp.")},
      {{"00", {"15.518", "6.599", "14.046", "10.659", "4.749", "9.542", "31.31%"}},
       {"02", {"8.681", "4.508", "7.419", "7.897", "4.003", "6.911", "9.03%"}},
       {"03", {"6.452", "2.577", "5.916", "7.178", "2.982", "7.616", "-11.25%"}},
       {"04", {"0.481", "0.394", "0.276", "0.407", "0.338", "0.227", "15.38%"}},
       {"05", {"8.05", "3.531", "7.235", "8.008", "3.432", "7.236", "0.52%"}},
       {"06", {"7.143", "2.385", "6.733", "7.113", "2.344", "6.715", "0.42%"}},
       {"07", {"9.663", "4.304", "8.652", "9.758", "4.448", "8.686", "-0.98%"}},
       {"08", {"11.192", "5.077", "9.974", "10.901", "4.924", "9.725", "2.60%"}},
       {"09", {"8.148", "4.321", "6.908", "7.977", "4.266", "6.740", "2.10%"}},
       {"10", {"7.825", "3.089", "7.189", "7.760", "3.043", "7.139", "0.83%"}}}};
  return table;
}

const PublishedTable& PublishedProfiles() {
  static const PublishedTable table{
      {Shown("paper", "Tracking, s"), Shown("paper", "Detection, s"), Shown("paper", "RMSE, m")},
      {{"G1", {"0.156", "0.289", "0.022"}},
       {"G2", {"0.144", "0.271", "0.019"}},
       {"G3", {"0.143", "0.335", "0.021"}},
       {"G4", {"0.100", "0.329", "0.022"}},
       {"G5", {"0.103", "0.330", "0.021"}},
       {"G6", {"0.071", "0.330", "0.022"}},
       {"G7", {"0.051", "0.307", "0.026"}},
       {"G8", {"0.045", "0.050", "0.016"}}}};
  return table;
}

const PublishedTable& PublishedTumOthers() {
  static const PublishedTable table{
      {Shown("published", "ORB-SLAM"), Shown("published", "DynaSLAM"), Shown("published", "DROID-SLAM (GPU)"),
       Shown("published", "WildGS-SLAM (GPU)"), Shown("published", "DROID-W (GPU)")},
      {{"fr3_walking_static", {"-", "-", "1.2", "0.4", "0.5"}},
       {"fr3_walking_xyz", {"1.2 (58%)", "1.4 (87%)", "1.6", "1.3", "1.2"}},
       {"fr3_walking_rpy", {"-", "-", "4.0", "3.3", "3.1"}},
       {"fr3_walking_halfsphere", {"1.7 (87%)", "2.1 (98%)", "2.2", "1.6", "1.6"}},
       {"fr3_sitting_xyz", {"0.7 (91%)", "1.3 (100%)", "0.9", "0.8", "0.8"}},
       {"fr3_sitting_rpy", {"-", "-", "2.2", "2.4", "2.1"}},
       {"fr3_sitting_halfsphere", {"1.34", "-", "1.4", "2.0", "1.4"}},
       {"fr2_desk_with_person", {"0.6 (95%)", "0.8 (97%)", "0.6", "1.4", "1.1"}}}};
  return table;
}

}  // namespace dynamic_slam
