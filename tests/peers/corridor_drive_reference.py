import csv
from p5_vp import *
D=os.path.join(os.environ.get('YAMABICO_DATA','../../../shared/data'),'corridor_drive','')
e=[];ok=n=0
for r in csv.DictReader(open(D+'labels.csv')):
    f=D+'images/'+r['name']+'.jpg'
    if not r['polygon_vp_x'] or not os.path.exists(f): continue
    im=cv2.imread(f,0); h,w=im.shape
    p=vote(*prep(seg_fld(im),25),W=w,H=h); x=float(r['polygon_vp_x']); d=abs(p[0]-x) if np.isfinite(p[0]) else 480
    e.append(d); o=x-(w-1)/2
    if abs(o)>10: n+=1; g=(p[0]-(w-1)/2)*o>0; ok+=g
print('%d frames, column error median %.1f, 90 %% %.1f px; steering sign right in %d of %d'%(len(e),np.median(e),np.percentile(e,90),ok,n))
