//! probe
use nalgebra::*;
use ramphold::{
    dataset,
    fit::*,
    wrist::{Request, Response, Width, simulate},
};
fn main() {
    let mut sums = vec![0.0; 40];
    let mut count = 0.0;
    let mut zm = vec![[0.0; 5]; 40];
    let mut mean = DVector::zeros(100);
    let mut sq = DVector::zeros(100);
    for path in std::env::args().skip(1) {
        let dir = std::path::Path::new(&path);
        let session = dataset::load(dir).unwrap();
        let name = dir.file_name().unwrap().to_str().unwrap();
        let truth: serde_json::Value = serde_json::from_str(
            &std::fs::read_to_string(dir.parent().unwrap().join(format!("truth/{name}.json"))).unwrap(),
        )
        .unwrap();
        let prepared = Prepared::new(&session, View::default()).unwrap();
        let pts = looks(&prepared);
        let mut cov = covariances(&prepared, &pts[0]);
        println!(
            "angle part sd at end {:.5}",
            (cov[0].covariance[(24, 24)] - prepared.noises[0].covariance[(24, 24)]).sqrt()
        );
        if std::env::var("NOANGLE").is_ok() {
            cov = prepared.noises.clone();
        }
        let wh = whiteners(&prepared, &cov);
        for (i, t) in prepared.trials.iter().enumerate() {
            let tr = truth["trials"]
                .as_array()
                .unwrap()
                .iter()
                .find(|x| x["trial"].as_u64() == Some(t.number as u64))
                .unwrap();
            let p: Vec<f64> =
                ramphold::wrist::BASE_PARAMETERS.iter().map(|n| tr[*n].as_f64().unwrap()).collect();
            let req = Request {
                lever: prepared.lever,
                kinds: &[],
                period_s: prepared.period_s,
                samples: prepared.samples,
                lead: prepared.lead,
                substeps: 4,
                filter: &prepared.sections,
                wanted: &[],
                width: Width::fastest(),
            };
            let mut r = Response::default();
            simulate(&req, &[&t.input], &p, &mut r);
            let res: DVector<f64> =
                DVector::from_vec(t.measured_nm.clone()) - DVector::from_vec(r.torque_nm.clone());
            let z = &wh[prepared.noise_of[i].unwrap()] * &res;
            for (k, v) in z.iter().enumerate() {
                sums[k] += v * v;
                zm[k][0] += v / (t.velocity_rad_s);
                let c = ((t.velocity_rad_s - 1.3) / 0.65).round() as usize;
                zm[k][1 + c] += v * v / 27.0;
            }
            count += 1.0;
            mean += &res;
            sq += res.component_mul(&res);
        }
    }
    println!("{}", sums.iter().map(|s| format!("{:.2}", s / count)).collect::<Vec<_>>().join(" "));
    for k in 0..20 {
        println!(
            "{k} mean z/v {:.3} sqrt ev {:.6}  var by velocity {:?}",
            zm[k][0] / count,
            0.0,
            &zm[k][1..].iter().map(|x| (x * 100.0).round() / 100.0).collect::<Vec<_>>()
        );
    }
}
